"""The public functions that open paths: what a file, a folder or a stream holds, handed on to the library."""
