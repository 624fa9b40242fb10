"""What a robot senses of the world and of itself, and what its wheels do."""
