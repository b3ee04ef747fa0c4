"""Files written whole: a result directory, and the files of finished shards."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, fields
from importlib import metadata
from pathlib import Path
from typing import IO, Any

import numpy as np

from engine import notes
from engine.evaluation.result import Result
from engine.evaluation.summary import Spread, Summary
from engine.runner import Shard
from engine.statistics import Total, Totals
from engine.tracks import Belief, Innovations, PacketCount, Reference, Samples, Series, Tracks
from server.wire import dumps, plain

RESULT, ARRAYS, VERSIONS, SUMS = "result.json", "arrays.npz", "versions.json", "SHA256SUMS"


def graph_file(algorithm: str) -> str:
    """The name of the file with the factor graphs and broadcasts of an algorithm that tells of them."""
    return f"graph-{algorithm}.json"


def sha256(path: Path) -> str:
    """The checksum of a file, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_whole(path: Path, write: Callable[[IO[bytes]], object]) -> str:
    """Write a file so that it is there completely, even after a power cut, or not at all; its checksum."""
    handle, temporary = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        digest = sha256(Path(temporary))
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
    return digest


def write_sums(folder: Path, names: Sequence[str]) -> None:
    """Note the checksums of files in their folder, as `sha256sum --check` reads them."""
    write_text(folder / SUMS, "".join(f"{sha256(folder / name)}  {name}\n" for name in names))


def read_sums(folder: Path) -> dict[str, str]:
    """The checksums noted in a folder, by file name; none where none were noted."""
    try:
        lines = (folder / SUMS).read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        return {}
    return {name: digest for digest, _, name in (line.partition("  ") for line in lines)}


def sound(folder: Path) -> bool:
    """Whether a folder's checksums were noted and all its files are as they were then."""
    sums = read_sums(folder)
    return bool(sums) and all((folder / n).is_file() and sha256(folder / n) == digest for n, digest in sums.items())


def write_text(path: Path, text: str) -> str:
    """Write a text file whole; its checksum."""
    return write_whole(path, lambda file: file.write(text.encode()))


def write_json(path: Path, value: Any) -> str:
    """Write a JSON file whole; NaN becomes null; its checksum."""
    return write_text(path, json.dumps(plain(value), allow_nan=False, ensure_ascii=False, indent=1) + "\n")


def write_arrays(path: Path, arrays: dict[str, np.ndarray]) -> str:
    """Write named arrays as npz whole; its checksum."""
    return write_whole(
        path,
        lambda file: np.savez(file, allow_pickle=False, **arrays),  # pyright: ignore[reportArgumentType]
    )


def versions() -> dict[str, str]:
    """The software that computes results here."""
    found = {name: metadata.version(name) for name in ("coopnav", "numpy", "scipy")}
    return found | {"python": platform.python_version()}


def write_result(directory: Path, result: Result) -> None:
    """Write result.json and arrays.npz into a directory, and what computed them; result.json last."""
    directory.mkdir(parents=True, exist_ok=True)
    write_json(directory / VERSIONS, versions())
    write_arrays(directory / ARRAYS, result.arrays())
    for name, tracks in result.tracks.items():
        if tracks.graph:
            write_text(directory / graph_file(name), dumps(tracks.graph))
    write_json(directory / RESULT, result.to_json())


def write_statistics(directory: Path, told: dict[str, Any]) -> None:
    """Write result.json of a run of which only statistics were kept, and what computed it."""
    directory.mkdir(parents=True, exist_ok=True)
    write_json(directory / VERSIONS, versions())
    write_json(directory / RESULT, told)


def write_totals(path: Path, totals: Totals) -> str:
    """Write what a batch of trials left; the file's checksum."""
    arrays: dict[str, np.ndarray] = {}
    meta = []
    for n, (name, total) in enumerate(totals.items()):
        rest = {"packets": asdict(total.packets), "notes": [note.plain() for note in total.notes], "cpu_s": total.cpu_s}
        meta.append(rest | {"name": name, "subjects": list(total.summaries)})
        for k, summary in enumerate(total.summaries.values()):
            for key, value in vars(summary).items():
                parts = vars(value) if isinstance(value, Spread) else {"": value}
                arrays |= {f"{n}/{k}/{key}/{part}": np.asarray(inside) for part, inside in parts.items()}
    arrays["meta"] = np.frombuffer(json.dumps(meta).encode(), dtype=np.uint8)
    return write_arrays(path, arrays)


def read_totals(path: Path) -> Totals:
    """Read what `write_totals` wrote."""
    with np.load(path, allow_pickle=False) as file:
        arrays = {key: file[key] for key in file.files}

    def value(place: str) -> Any:
        if f"{place}/" in arrays:
            return _plain(arrays[f"{place}/"])
        return Spread(**{key.rsplit("/", 1)[1]: _plain(v) for key, v in arrays.items() if key.startswith(f"{place}/")})

    totals = {}
    for n, rest in enumerate(json.loads(arrays["meta"].tobytes())):
        summaries = {
            subject: Summary(**{f.name: value(f"{n}/{k}/{f.name}") for f in fields(Summary)})
            for k, subject in enumerate(rest["subjects"])
        }
        packets = PacketCount(**rest["packets"])
        totals[rest["name"]] = Total(summaries, packets, _notes(rest["notes"]), rest["cpu_s"])
    return totals


def _notes(written: list[Any]) -> tuple[notes.Note, ...]:
    """Notes as they were written; as words alone by earlier versions."""
    return tuple(notes.of_plain([note] if isinstance(note, str) else note) for note in written)


def _plain(value: np.ndarray) -> Any:
    return value if value.ndim else value.item()


def write_shard(path: Path, shard: Shard, reference: Reference, tracks: Tracks) -> str:
    """Write a finished shard: its answer and the truth of its trials; the file's checksum."""
    arrays: dict[str, np.ndarray] = {"time_s": reference.time_s}
    meta: dict[str, Any] = {
        "algorithm": shard.algorithm,
        "trials": list(shard.trials),
        "truth": list(reference.truth),
        "beliefs": list(tracks.beliefs),
        "samples": list(tracks.samples),
        "innovations": list(tracks.innovations),
        "series": [[key, s.title, s.unit, list(s.subjects)] for key, s in tracks.series.items()],
        "packets": asdict(tracks.packets),
        "notes": [note.plain() for note in notes.join(tracks.notes)],
        "cpu_s": tracks.cpu_s,
        "graph": tracks.graph,
    }
    for n, value in enumerate(reference.truth.values()):
        arrays[f"truth/{n}"] = value
    for room in ("beliefs", "samples", "innovations"):
        for n, item in enumerate(getattr(tracks, room).values()):
            arrays |= {f"{room}/{n}/{name}": value for name, value in vars(item).items()}
    for n, series in enumerate(tracks.series.values()):
        arrays[f"series/{n}"] = series.value
    arrays["meta"] = np.frombuffer(json.dumps(meta).encode(), dtype=np.uint8)
    return write_arrays(path, arrays)


def read_shard(path: Path) -> tuple[Shard, Reference, Tracks]:
    """Read what `write_shard` wrote."""
    with np.load(path, allow_pickle=False) as file:
        arrays = {key: file[key] for key in file.files}
    meta = json.loads(arrays["meta"].tobytes())

    def items(room: str, kind: Callable[..., Any]) -> dict[str, Any]:
        return {
            name: kind(**{k.rsplit("/", 1)[1]: v for k, v in arrays.items() if k.startswith(f"{room}/{n}/")})
            for n, name in enumerate(meta[room])
        }

    reference = Reference(arrays["time_s"], {name: arrays[f"truth/{n}"] for n, name in enumerate(meta["truth"])})
    tracks = Tracks(
        beliefs=items("beliefs", Belief),
        packets=PacketCount(**meta["packets"]),
        samples=items("samples", Samples),
        innovations=items("innovations", Innovations),
        series={
            key: Series(title, unit, arrays[f"series/{n}"], tuple(subjects))
            for n, (key, title, unit, subjects) in enumerate(meta["series"])
        },
        notes=_notes(meta["notes"]),
        cpu_s=meta["cpu_s"],
        graph=meta.get("graph", {}),
    )
    return Shard(meta["algorithm"], tuple(meta["trials"])), reference, tracks
