"""Operations on numbers, read off programs of JAX, and written as statements."""
