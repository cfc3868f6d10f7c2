"""Templates of generated text."""

import jinja2


def environment(package: str, folder: str = "templates") -> jinja2.Environment:
    """Templates of a package; a name that is not known is an error, lines with nothing but a block vanish."""
    return jinja2.Environment(  # noqa: S701 - C has no markup to escape; what else is written escapes what it inserts
        loader=jinja2.PackageLoader(package, folder),
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
