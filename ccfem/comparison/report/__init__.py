"""A page that holds its own data and draws itself in the browser."""
