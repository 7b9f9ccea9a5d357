"""What every room needs and no user imports: checks of arguments, parameters, columns, files, limits."""
