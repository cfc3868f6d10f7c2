"""Templates of generated text."""

import pickle

import jinja2
from jinja2.bccache import Bucket

from tendonff.ocp.codegen.compiler import cache_folder
from tendonff.ocp.codegen.leftovers import temporary_name


class _Translated(jinja2.BytecodeCache):
    """Templates as bytecode, beside the compiled libraries; where nothing can be kept they are translated each time."""

    def load_bytecode(self, bucket: Bucket) -> None:
        """Fill a bucket with what is kept; one of another text or interpreter, or torn, stays empty."""
        try:
            bucket.bytecode_from_string((cache_folder() / f"{bucket.key}.template").read_bytes())
        except (OSError, EOFError, pickle.UnpicklingError):
            bucket.reset()

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Keep a bucket, whole or not at all."""
        try:
            folder = cache_folder()
            partial = folder / temporary_name(bucket.key)
            partial.write_bytes(bucket.bytecode_to_string())
            partial.replace(folder / f"{bucket.key}.template")
        except OSError:
            return


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
        bytecode_cache=_Translated(),
    )
