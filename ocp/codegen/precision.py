"""Real type of generated C; apart from the printer, because the command line imports it."""

from tendonff.models.choice import Choice


class Precision(Choice):
    """Real type of generated C, by its name there."""

    DOUBLE = "double"
    FLOAT = "float"
