"""The public Python functions of `coupled`: they check arguments and call subpackages."""
