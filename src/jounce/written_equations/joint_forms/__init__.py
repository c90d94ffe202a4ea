"""Readable equations of joints in the notation of Sommer 2024."""
