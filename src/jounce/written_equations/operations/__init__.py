"""Operations on numbers, read from JAX programs and written as statements."""
