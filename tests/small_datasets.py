"""Small LeRobot datasets, formats v2.1 and v3.0, written with pyarrow alone as LeRobot 0.3.3 and 0.4.4 write them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import parquet

DEFAULTS = {
    "timestamp": {"dtype": "float32", "shape": [1], "names": None},
    **{name: {"dtype": "int64", "shape": [1], "names": None} for name in ("frame_index", "episode_index", "index")},
    "task_index": {"dtype": "int64", "shape": [1], "names": None},
}
FPS = 30
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}

Columns = dict[str, np.ndarray]


def stats(values: np.ndarray, quantiles: bool) -> dict[str, list[float] | list[int]]:
    """The statistics of a column (k, d), by their definitions."""
    found = {"min": values.min(0), "max": values.max(0), "mean": values.mean(0), "std": values.std(0)}
    if quantiles:
        found |= {name: np.quantile(values, q, axis=0) for name, q in QUANTILES.items()}
    return {name: v.astype(float).tolist() for name, v in found.items()} | {"count": [len(values)]}


def write_dataset(
    folder: Path, episodes: Sequence[Columns], names: dict[str, list[str] | None], *, version: str = "v3.0",
    robot_type: str = "panda", per_file: int = 2, video: bool = False, dtype: str = "float32",
) -> Path:  # fmt: skip
    """A dataset of episodes, each of columns (k, d); v3.0 with `per_file` episodes in a data file."""
    features = {
        name: {"dtype": dtype, "shape": [column.shape[1]], "names": names.get(name)}
        for name, column in episodes[0].items()
    }
    if video:
        sides = {"shape": [4, 6, 3], "names": ["height", "width", "channels"]}
        features["observation.images.top"] = {"dtype": "video", **sides}
    info = {
        "codebase_version": version, "robot_type": robot_type, "total_episodes": len(episodes),
        "total_frames": sum(len(next(iter(columns.values()))) for columns in episodes),
        "total_tasks": 1, "chunks_size": 1000, "fps": FPS, "splits": {"train": f"0:{len(episodes)}"},
        "features": features | DEFAULTS,
    }  # fmt: skip
    (folder / "meta").mkdir(parents=True)
    tables, first = [], 0
    for number, columns in enumerate(episodes):
        count = len(next(iter(columns.values())))
        tables.append(_table(columns, number, first, count, dtype))
        first += count
    if version == "v3.0":
        _write_v3(folder, info, tables, per_file, video)
    else:
        _write_v2(folder, info, tables, video)
    (folder / "meta" / "info.json").write_text(json.dumps(info, indent=4))
    return folder


def _table(columns: Columns, episode: int, first: int, count: int, dtype: str) -> pa.Table:
    kind = pa.float32() if dtype == "float32" else pa.float64()
    found = {
        name: pa.FixedSizeListArray.from_arrays(pa.array(values.ravel(), kind), values.shape[1])
        if values.shape[1] > 1
        else pa.array(values.ravel(), kind)
        for name, values in columns.items()
    }
    found |= {
        "timestamp": pa.array(np.arange(count) / FPS, pa.float32()), "frame_index": pa.array(np.arange(count)),
        "episode_index": pa.array(np.full(count, episode)), "index": pa.array(first + np.arange(count)),
        "task_index": pa.array(np.zeros(count, np.int64)),
    }  # fmt: skip
    return pa.table(found)


def _numbers(table: pa.Table, name: str) -> np.ndarray:
    column = table[name].combine_chunks()
    flat = column.flatten() if pa.types.is_fixed_size_list(column.type) else column
    return flat.to_numpy(zero_copy_only=False).astype(float).reshape(len(table), -1)


def _write_v3(folder: Path, info: dict, tables: list[pa.Table], per_file: int, video: bool) -> None:
    info |= {
        "data_files_size_in_mb": 100, "video_files_size_in_mb": 200,
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4" if video else None,
    }  # fmt: skip
    rows, first = [], 0
    for number, table in enumerate(tables):
        row = {
            "episode_index": number, "tasks": ["reach"], "length": len(table), "data/chunk_index": 0,
            "data/file_index": number // per_file, "dataset_from_index": first, "dataset_to_index": first + len(table),
            "meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0,
        }  # fmt: skip
        if video:
            key = "videos/observation.images.top"
            row |= {
                f"{key}/chunk_index": 0, f"{key}/file_index": 0, f"{key}/from_timestamp": first / FPS,
                f"{key}/to_timestamp": (first + len(table)) / FPS,
            }  # fmt: skip
        for name in table.column_names:
            for what, value in stats(_numbers(table, name), True).items():
                row[f"stats/{name}/{what}"] = value
        rows.append(row)
        first += len(table)
    (folder / "meta" / "episodes" / "chunk-000").mkdir(parents=True)
    parquet.write_table(pa.Table.from_pylist(rows), folder / "meta/episodes/chunk-000/file-000.parquet")
    (folder / "data" / "chunk-000").mkdir(parents=True)
    for start in range(0, len(tables), per_file):
        file = folder / f"data/chunk-000/file-{start // per_file:03d}.parquet"
        parquet.write_table(pa.concat_tables(tables[start : start + per_file]), file)
    import pandas as pd  # which takes as long as NumPy and SciPy together

    pd.DataFrame({"task_index": [0]}, index=["reach"]).to_parquet(folder / "meta" / "strategies.tasks.parquet")
    whole = {name: np.vstack([_numbers(t, name) for t in tables]) for name in tables[0].column_names}
    text = json.dumps({name: stats(values, True) for name, values in whole.items()}, indent=4)
    (folder / "meta" / "stats.json").write_text(text)
    if video:
        file = folder / "videos/observation.images.top/chunk-000/file-000.mp4"
        file.parent.mkdir(parents=True)
        file.write_bytes(b"not decoded by these tests")


def _write_v2(folder: Path, info: dict, tables: list[pa.Table], video: bool) -> None:
    info |= {
        "total_videos": len(tables) * video, "total_chunks": 1,
        "data_path": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
        "video_path": "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4" if video else None,
    }  # fmt: skip
    (folder / "data" / "chunk-000").mkdir(parents=True)
    episodes, found = [], []
    for number, table in enumerate(tables):
        parquet.write_table(table, folder / f"data/chunk-000/episode_{number:06d}.parquet")
        episodes.append({"episode_index": number, "tasks": ["reach"], "length": len(table)})
        columns = {name: stats(_numbers(table, name), False) for name in table.column_names}
        found.append({"episode_index": number, "stats": columns})
        if video:
            file = folder / f"videos/chunk-000/observation.images.top/episode_{number:06d}.mp4"
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(b"not decoded by these tests")
    for name, values in {
        "episodes": episodes, "episodes_stats": found, "tasks": [{"task_index": 0, "task": "reach"}],
    }.items():  # fmt: skip
        lines = "".join(json.dumps(value) + "\n" for value in values)
        (folder / "meta" / f"{name}.jsonl").write_text(lines)
