"""Export: an evolved team as a file that runs without conevo."""
