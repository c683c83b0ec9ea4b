"""What the command ``planlang`` can do: ``recipes``, ``runs`` and ``places``, with what they share in ``options``."""
