"""Old jobs make room: those that ended long ago, or most long ago when they take too much disk; never a pinned one."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

from server.settings import Settings
from server.store import Job, Store


def superfluous(store: Store, folders: Path, settings: Settings, now: datetime | None = None) -> list[Job]:
    """The jobs to delete: ended, not pinned, and too old or, oldest first, too much; pinned ones count as space."""
    ended = sorted(store.ended(), key=lambda job: job.finished_at or job.created_at)
    free = [job for job in ended if not job.pinned]
    going: list[Job] = []
    if settings.keep_days is not None:
        oldest = (now or datetime.now(UTC)) - timedelta(days=settings.keep_days)
        going = [job for job in free if datetime.fromisoformat(job.finished_at or job.created_at) < oldest]
    if settings.keep_bytes is not None:
        taken = {job.id: _size(folders / job.id) for job in ended}
        total = sum(taken.values()) - sum(taken[job.id] for job in going)
        for job in free:
            if total <= settings.keep_bytes:
                break
            if job not in going:
                going.append(job)
                total -= taken[job.id]
    return going


def _size(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.glob("*") if path.is_file())
