"""What makes the page of reliability: each module gathers the data of a section."""
