"""The languages of written equations."""
