"""The print: layers of matrix and fibre, and all machine actions that lay them, as a table."""
