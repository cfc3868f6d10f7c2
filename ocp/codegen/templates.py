"""Templates of generated text."""

import jinja2


def environment(package: str, *folders: str) -> jinja2.Environment:
    """Templates in folders of a package, by default "templates"; of one name the first folder's counts.

    A name that is not known is an error, lines with nothing but a block vanish.
    """
    places = [jinja2.PackageLoader(package, each) for each in folders or ("templates",)]
    return jinja2.Environment(  # noqa: S701 - C has no markup to escape; what else is written escapes what it inserts
        loader=jinja2.ChoiceLoader(places),
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
