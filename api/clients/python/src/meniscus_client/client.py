"""Jobs, studies and uploads of a service."""

from __future__ import annotations

import csv
import io
import json
import random
import time
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import requests

from .frames import Frame

if TYPE_CHECKING:
    import pandas

    from . import models

#: States that nothing follows.
ENDED = frozenset({"succeeded", "failed", "canceled"})
#: Answers after which a request is sent again: the service is busy, or is being started.
AGAIN = frozenset({429, 502, 503, 504})
TRIES = 6
LONGEST_PAUSE_S = 5.0


class Refused(Exception):
    """What the service says where it refuses a request (RFC 9457)."""

    def __init__(self, problem: models.Problem) -> None:
        self.problem = problem
        lines = [problem.get("detail") or problem["title"]]
        for error in problem.get("errors") or []:
            lines.append(f"  {error['pointer'] or '/'}: {error['detail']}")
        super().__init__("\n".join(lines))

    @property
    def status(self) -> int:
        """The HTTP status."""
        return self.problem["status"]


class Ended(Exception):
    """A job or a study has ended otherwise than wanted."""


class Meniscus:
    """A service at an address, with a token where it asks for one."""

    def __init__(self, address: str = "http://127.0.0.1:8080", token: str | None = None, timeout_s: float = 60.0) -> None:
        self.address = address.rstrip("/")
        self._timeout_s = timeout_s
        self._session = requests.Session()
        if token:
            self._session.headers["Authorization"] = f"Bearer {token}"

    def request(self, method: str, path: str, **options: Any) -> requests.Response:
        """One request to a path below the address. It is sent again while the service is away or busy; creations carry a key, so that
        nothing is made twice.
        """
        if method == "POST":
            options.setdefault("headers", {}).setdefault("Idempotency-Key", uuid.uuid4().hex)
        for attempt in range(TRIES):
            is_last = attempt == TRIES - 1
            try:
                answer = self._session.request(method, f"{self.address}{path}", timeout=self._timeout_s, **options)
            except requests.ConnectionError:
                if is_last:
                    raise
            else:
                if answer.ok:
                    return answer
                if is_last or answer.status_code not in AGAIN:
                    raise Refused(_problem(answer))
            time.sleep(min(LONGEST_PAUSE_S, 0.2 * 2**attempt) * (0.5 + random.random()))
        raise AssertionError("the loop returns or raises")

    def get(self, path: str, **query: Any) -> Any:
        """What a path answers, read from JSON."""
        return self.request("GET", path, params={name: value for name, value in query.items() if value is not None}).json()

    def _items(self, path: str, **query: Any) -> Iterator[Any]:
        cursor = None
        while True:
            page = self.get(path, cursor=cursor, **query)
            yield from page["items"]
            cursor = page.get("next")
            if cursor is None:
                return

    def scenes(self) -> list[models.SceneKindView]:
        """The kinds of scenes."""
        return self.get("/v1/scenes")["items"]

    def estimate(self, body: dict[str, Any]) -> models.EstimateView:
        """What a job would need; nothing is made."""
        return self.request("POST", "/v1/estimates", json=body).json()

    def submit(self, body: dict[str, Any]) -> Job:
        """A new job."""
        return Job(self, self.request("POST", "/v1/jobs", json=body).json())

    def job(self, id: str) -> Job:
        """A job by its id."""
        return Job(self, self.get(f"/v1/jobs/{id}"))

    def jobs(self, **filters: Any) -> Iterator[Job]:
        """Jobs that filters let through (those of ``GET /v1/jobs``), the newest first."""
        return (Job(self, view) for view in self._items("/v1/jobs", **filters))

    def submit_study(self, body: dict[str, Any]) -> Study:
        """A new study."""
        return Study(self, self.request("POST", "/v1/studies", json=body).json())

    def study(self, id: str) -> Study:
        """A study by its id."""
        return Study(self, self.get(f"/v1/studies/{id}"))

    def studies(self) -> Iterator[Study]:
        """All studies."""
        return (Study(self, view) for view in self._items("/v1/studies"))

    def upload(self, file: str | Path | bytes, purpose: str) -> Upload:
        """Uploads a file as ``points``, ``surface``, ``mesh``, ``queries``, ``values``, ``flow`` or ``checkpoint`` and waits until it is
        ready.

        Raises ``Ended`` with the reason where the service rejects the file.
        """
        content = file if isinstance(file, bytes) else Path(file).read_bytes()
        headers = {"Content-Type": "application/octet-stream"}
        view = self.request("POST", "/v1/uploads", params={"as": purpose}, data=content, headers=headers).json()
        while view["state"] == "quarantined":
            time.sleep(0.2)
            view = self.get(f"/v1/uploads/{view['id']}")
        if view["state"] != "ready":
            raise Ended(f"the upload is {view['state']}: {view.get('reason')}")
        return Upload(self, view)


class _Thing:
    """What has an id and a view that changes."""

    _path: str

    def __init__(self, service: Meniscus, view: Any) -> None:
        self._service = service
        self.view = view

    @property
    def id(self) -> str:
        return self.view["id"]

    @property
    def path(self) -> str:
        return f"{self._path}/{self.id}"

    def refresh(self) -> Any:
        """Asks the service anew; the view."""
        self.view = self._service.get(self.path)
        return self.view

    def delete(self) -> None:
        """Deletes it with its files."""
        self._service.request("DELETE", self.path)

    def _act(self, action: str) -> Any:
        return self._service.request("POST", f"{self.path}/{action}").json()

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.id} {self.view.get('state')}>"


class Upload(_Thing):
    """A file of one's own on the service."""

    _path = "/v1/uploads"
    view: models.UploadView


class Job(_Thing):
    """A run."""

    _path = "/v1/jobs"
    view: models.JobView

    @property
    def state(self) -> str:
        """The state when it was last asked for."""
        return self.view["state"]

    def wait(
        self,
        timeout_s: float | None = None,
        shows: bool = True,
        told: Callable[[models.JobView], None] | None = None,
    ) -> Job:
        """Waits for the end of the job, with a progress bar where ``tqdm`` is installed; ``told`` hears of every look.

        Raises ``Ended`` with message and hint where the job does not succeed, ``TimeoutError`` after ``timeout_s``.
        """
        end = None if timeout_s is None else time.monotonic() + timeout_s
        pause = 0.1
        with _Bar(self.view.get("name") or self.id, shows) as bar:
            while True:
                view = self.refresh()
                bar.show(view["progress"]["fraction"], view["state"])
                if told:
                    told(view)
                if view["state"] in ENDED:
                    break
                if end is not None and time.monotonic() > end:
                    raise TimeoutError(f"{self.id} is {view['state']} after {timeout_s} s")
                time.sleep(pause)
                pause = min(2.0, 1.3 * pause)
        if self.state != "succeeded":
            said = [self.view.get("message"), self.view.get("hint")]
            raise Ended(f"{self.id} {self.state}: " + " ".join(text for text in said if text))
        return self

    def pause(self) -> Job:
        """Lets the job rest after a checkpoint."""
        self.view = self._act("pause")
        return self

    def resume(self) -> Job:
        """Lets a paused job go on."""
        self.view = self._act("resume")
        return self

    def cancel(self) -> Job:
        """Ends the job."""
        self.view = self._act("cancel")
        return self

    def restart(self, checkpoint: str | None = None, **changes: Any) -> Job:
        """A job that goes on from a checkpoint, the last one when none is given, with other values of restart-safe fields of the
        scene, such as ``end_time=2``.
        """
        source = {"checkpoint": checkpoint} if checkpoint else {"job": self.id}
        overrides = {f"/{name}": value for name, value in changes.items()}
        return self._service.submit({"restart": {**source, "overrides": overrides}})

    def report(self) -> models.ReportView:
        """Errors, health and cost of a job that has succeeded."""
        return self._service.get(f"{self.path}/report")

    def checkpoints(self) -> list[models.CheckpointView]:
        """Checkpoints, the oldest first."""
        return self._service.get(f"{self.path}/checkpoints")["items"]

    def files(self) -> list[models.FileView]:
        """Files, frames among them."""
        return list(self._service._items(f"{self.path}/files"))

    def download(self, path: str) -> bytes:
        """The content of a file."""
        return self._service.request("GET", f"{self.path}/files/{path}").content

    def rows(self) -> list[dict[str, float | None]]:
        """The series, a dictionary a row; None where a column has no value."""
        text = self._service.request("GET", f"{self.path}/series", headers={"Accept": "text/csv"}).text
        return [{name: _number(value) for name, value in row.items()} for row in csv.DictReader(io.StringIO(text))]

    def series(self) -> pandas.DataFrame:
        """The series as a table by time; needs the extra ``data``."""
        import pandas

        return pandas.DataFrame(self.rows()).set_index("time")

    def frame_paths(self) -> list[str]:
        """Paths of the frames, in the order of their times."""
        return sorted(file["path"] for file in self.files() if file["path"].startswith("frames/"))

    def frame(self, number: int = -1) -> Frame:
        """A frame as NumPy arrays, the last one when no number is given; needs the extra ``data``."""
        return Frame.read(self.download(self.frame_paths()[number]))

    def frames(self) -> Iterator[Frame]:
        """All frames, one after the other."""
        return (Frame.read(self.download(path)) for path in self.frame_paths())


class Study(_Thing):
    """Jobs that differ in some parameters, or levels of refinement."""

    _path = "/v1/studies"
    view: models.StudyView

    def wait(self, timeout_s: float | None = None, shows: bool = True) -> Study:
        """Waits for the end of all its jobs.

        Raises ``Ended`` where the study does not succeed, ``TimeoutError`` after ``timeout_s``.
        """
        end = None if timeout_s is None else time.monotonic() + timeout_s
        with _Bar(self.view.get("name") or self.id, shows) as bar:
            while True:
                view = self.refresh()
                bar.show(view["fraction"], view["state"])
                if view["state"] in ENDED:
                    break
                if end is not None and time.monotonic() > end:
                    raise TimeoutError(f"{self.id} is {view['state']} after {timeout_s} s")
                time.sleep(0.5)
        if view["state"] != "succeeded":
            raise Ended(f"{self.id} {view['state']}: {view.get('message') or view['counts']}")
        return self

    def rows(self) -> list[dict[str, Any]]:
        """One row for each point: its values, its job, state and errors."""
        rows: list[dict[str, Any]] = []
        after = None
        while True:
            query = {"limit": 1000, **({} if after is None else {"after": after})}
            headers = {"Accept": "application/json"}
            page = self._service.request("GET", f"{self.path}/table", params=query, headers=headers).json()
            rows += page["rows"]
            after = page.get("next")
            if not after:
                return rows

    def table(self) -> pandas.DataFrame:
        """The rows as a table; needs the extra ``data``."""
        import pandas

        return pandas.DataFrame(self.rows())

    def report(self) -> dict[str, Any]:
        """Errors over spacing and cost with fitted orders; of a study that refines its levels, order and grid convergence index."""
        return self._service.get(f"{self.path}/report")


class _Bar:
    """A progress bar of tqdm, or none."""

    def __init__(self, name: str, shows: bool) -> None:
        self._bar = None
        if shows:
            try:
                from tqdm.auto import tqdm
            except ImportError:
                return
            self._bar = tqdm(total=1.0, desc=name, bar_format="{desc}: {percentage:3.0f}%|{bar}| {postfix}")

    def __enter__(self) -> _Bar:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def show(self, fraction: float, state: str) -> None:
        if self._bar is not None:
            self._bar.n = fraction
            self._bar.set_postfix_str(state)


def _number(text: str | None) -> float | None:
    return float(text) if text else None


def _problem(answer: requests.Response) -> Any:
    try:
        problem = answer.json()
    except json.JSONDecodeError:
        problem = None
    if isinstance(problem, dict) and "title" in problem:
        return {"status": answer.status_code, **problem}
    return {"type": "about:blank", "title": answer.text or answer.reason, "status": answer.status_code}
