"""The print: layers of matrix and fibre, and all that a machine does to lay them, as a table."""
