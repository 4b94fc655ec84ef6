"""The passes, one module per method. A class here and its shader are one thing in two languages."""
