"""The numeric model of a mechanism, also with parameters that JAX traces."""
