"""Equations of joints in the notation of Sommer 2024, as a person reads them."""
