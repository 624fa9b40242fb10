"""Export of the compiled functions as C99, WebAssembly and a Python extension."""
