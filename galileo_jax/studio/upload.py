"""Files that are dropped on the page: taken in as a stream, checked by content, never run."""

from collections.abc import AsyncIterator
from pathlib import Path
from tempfile import NamedTemporaryFile

from galileo_jax.api.look import look
from galileo_jax.clip.file_kinds import FILM_SUFFIXES, TRACK_SUFFIXES, YAML_SUFFIXES, is_yaml
from galileo_jax.clip.schema import ClipFile
from galileo_jax.clip.yaml_file import read_mapping
from galileo_jax.runtime.errors import InputError
from galileo_jax.studio.paths import below, check_declared, safe_name
from galileo_jax.video.decode import probe

UPLOAD = "/upload/"  # the address that takes them
LARGEST_BYTES = 1_000_000_000
LARGEST_OTHERS = {
    **dict.fromkeys(TRACK_SUFFIXES, 20_000_000),
    **dict.fromkeys(YAML_SUFFIXES, 1_000_000),
}


async def receive(
    root: Path, name: str, chunks: AsyncIterator[bytes], limit: int = LARGEST_BYTES
) -> Path:
    """Writes an upload into the folder once it is complete and what its name says.

    Raises:
      InputError: the name climbs out of the folder or is taken, the file is too large, or its
        content is no video, no table and no clip's yaml; nothing is left behind.
    """
    safe_name(name)
    suffix = Path(name).suffix.lower()
    if suffix not in (*FILM_SUFFIXES, *YAML_SUFFIXES, *TRACK_SUFFIXES):
        raise InputError(f"{name}: a video, a table or a yaml expected")
    target = below(root, name)
    if target.exists():
        raise InputError(f"{name}: there is such a file already; rename one of them")
    limit = min(limit, LARGEST_OTHERS.get(suffix, limit))
    with NamedTemporaryFile(dir=root, prefix=".upload_", suffix=suffix, delete=False) as file:
        part = Path(file.name)
        try:
            size = 0
            async for chunk in chunks:
                size += len(chunk)
                if size > limit:
                    raise InputError(f"{name}: larger than {limit // 1_000_000} MB")
                file.write(chunk)
            file.flush()
            _check(root, part, name)
            part.chmod(0o644)
            part.rename(target)
        finally:
            part.unlink(missing_ok=True)
    return target


def _check(root: Path, part: Path, name: str) -> None:
    """Raises `InputError`, with the name that the person gave it."""
    try:
        if is_yaml(part):
            content = read_mapping(part)
            if unknown := [key for key in content if key not in ClipFile.model_fields]:
                raise InputError(f"{unknown[0]}: unknown key; a clip's yaml expected")
            check_declared(root, root, content)
        elif part.suffix in TRACK_SUFFIXES:
            look(part)
        else:
            probe(part)
    except InputError as error:
        text = str(error).replace(str(part), name).removeprefix(f"{name}: ")
        raise InputError(f"{name}: {text}") from None
