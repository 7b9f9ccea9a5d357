"""Private base of all subpackages: checks of arguments, parameters, columns, files, limits."""
