"""Types of the answers of the service, written by generate.py."""

from __future__ import annotations

from typing import Any, NotRequired, TypedDict


class AccuracyView(TypedDict):
    """
    What came of an accuracy that was asked for.
    """

    quantity: Any
    tolerance: float
    predicted: float
    reached: NotRequired[float | None]
    met: bool


class CheckView(TypedDict):
    """
    An invariant that a scheme watches.
    """

    name: str
    value: NotRequired[float | None]
    limit: NotRequired[float | None]
    unit: str
    holds: NotRequired[bool | None]


class CheckpointView(TypedDict):
    """
    A checkpoint that was verified after it was written.
    """

    id: str
    job: str
    step: int
    time: float
    size_bytes: int
    sha256: str
    created_at: str
    isa: str
    build: str
    links: dict[str, str]


class CostView(TypedDict):
    """
    Cost of a run.
    """

    wall_s: float
    cpu_s: float
    steps: int
    particle_steps_per_s: float
    peak_memory_bytes: int
    phases: dict[str, float]


class DeterministicView(TypedDict):
    """
    Build and instruction set: equal values give equal results to the last bit.
    """

    build: str
    isa: str


class DiagnosticView(TypedDict):
    """
    A number that a method counts or measures about its own work.
    """

    name: str
    value: NotRequired[float | None]
    unit: str
    doc: str


class DryRunView(TypedDict):
    """
    Points and estimate of a study that was not created.
    """

    points: list[Any]
    estimate: Any


class ErrorView(TypedDict):
    """
    An error against a reference.
    """

    quantity: str
    norm: str
    value: NotRequired[float | None]
    time: float
    reference: str


class EventView(TypedDict):
    """
    An event in the life of a job.
    """

    id: int
    job: NotRequired[str | None]
    type: str
    at: str
    attempt: int
    data: Any


class FileView(TypedDict):
    """
    A file that a job has published.
    """

    path: str
    size_bytes: int
    sha256: str
    media_type: str
    time: NotRequired[float | None]
    step: NotRequired[int | None]


class FindingView(TypedDict):
    """
    Something that a run noticed.
    """

    code: str
    severity: str
    message: str
    count: int
    points: list[int]
    time: float
    step: int
    advice: NotRequired[str | None]


class HealthView(TypedDict):
    """
    Whether a job's results can be trusted, and what speaks against them.
    """

    status: NotRequired[str | None]
    finite: bool
    max_cfl: float
    volume_drift: NotRequired[float | None]
    checks: list[CheckView]
    findings: list[FindingView]


class LineageView(TypedDict):
    """
    Objects that a job was made from.
    """

    study: NotRequired[str | None]
    restarted_from: NotRequired[str | None]
    retry_of: NotRequired[str | None]


class ProblemItem(TypedDict):
    """
    One error of a body, a query parameter or a header.
    """

    pointer: str
    code: str
    detail: str
    got: Any
    allowed: Any
    did_you_mean: NotRequired[str | None]


class ProgressView(TypedDict):
    """
    Progress of a job.
    """

    fraction: float
    time: float
    end_time: float
    step: int
    steps_per_s: NotRequired[float | None]
    particles: int
    phase: str
    eta_s: NotRequired[float | None]
    eta_basis: NotRequired[str | None]


class ProvenanceView(TypedDict):
    """
    Where the numbers of a run come from.
    """

    build: str
    cpu: NotRequired[str | None]
    isa: str
    threads: int
    scene_sha256: str


class QuantityView(TypedDict):
    """
    A quantity that a kind of scene declares.
    """

    name: str
    unit: str
    doc: str


class ReportView(TypedDict):
    """
    The report of a finished job.
    """

    errors: list[ErrorView]
    cost: CostView
    health: HealthView
    diagnostics: list[DiagnosticView]
    accuracy: NotRequired[AccuracyView | None]
    method: dict[str, str]
    provenance: ProvenanceView


class SceneKindView(TypedDict):
    """
    A kind of scene.
    """

    kind: str
    title: str
    schema: Any
    presets: list[str]
    restart_safe: list[str]
    fields: list[QuantityView]
    observables: list[QuantityView]
    norms: list[QuantityView]
    example: Any


class ServiceLimits(TypedDict):
    """
    Limits of requests and jobs.
    """

    slots: int
    threads: int
    memory_bytes: int
    body_bytes: int
    study_bytes: int
    upload_bytes: int


class ServiceView(TypedDict):
    """
    Version and limits of the service.
    """

    name: str
    build: str
    isa: str
    limits: ServiceLimits
    links: dict[str, str]


class SkippedView(TypedDict):
    """
    A job that an action left as it is.
    """

    job: str
    reason: str


class StatusView(TypedDict):
    """
    Answer of a health check.
    """

    status: str


class StudyView(TypedDict):
    """
    A study: one body and a sweep of its values, run as one job for each point.
    """

    id: str
    name: NotRequired[str | None]
    labels: dict[str, str]
    state: str
    counts: dict[str, int]
    points: int
    fraction: float
    base: Any
    sweep: Any
    axes: list[str]
    max_parallel: NotRequired[int | None]
    on_failure: str
    estimate: Any
    outcome: NotRequired[str | None]
    message: NotRequired[str | None]
    owner: NotRequired[str | None]
    created_at: str
    links: dict[str, str]


class TicketView(TypedDict):
    """
    A ticket.
    """

    ticket: str
    expires_at: str


UploadView = TypedDict(
    'UploadView',
    {
        'id': str,
        'as': str,
        'state': str,
        'reason': NotRequired[str | None],
        'found': Any,
        'name': NotRequired[str | None],
        'size_bytes': int,
        'sha256': str,
        'owner': NotRequired[str | None],
        'created_at': str,
        'checked_at': NotRequired[str | None],
        'links': dict[str, str],
    },
)


class UsageView(TypedDict):
    """
    Resources that a job has used.
    """

    wall_s: float
    cpu_s: float
    peak_memory_bytes: int
    disk_bytes: int


class ActionView(TypedDict):
    """
    What an action on many jobs came to.
    """

    matched: int
    changed: int
    dry_run: bool
    skipped: list[SkippedView]


class CheckpointList(TypedDict):
    """
    All checkpoints of a job, newest first.
    """

    items: list[CheckpointView]
    next: NotRequired[str | None]


class EstimateView(TypedDict):
    """
    What a job would need.
    """

    resolved: Any
    study: NotRequired[Any]
    particles: int
    time_step: float
    steps: int
    memory_bytes: int
    disk_bytes: int
    cpu_s: NotRequired[float | None]
    wall_s: NotRequired[float | None]
    basis: str
    numbers: dict[str, float]
    warnings: list[FindingView]


class EventList(TypedDict):
    """
    A page of events.
    """

    items: list[EventView]
    next: NotRequired[int | None]


class FileList(TypedDict):
    """
    All published files of a job.
    """

    items: list[FileView]
    next: NotRequired[str | None]


class JobView(TypedDict):
    """
    A job: one simulation with its state, its progress and links to its results.
    """

    id: str
    rev: int
    state: str
    reason: NotRequired[str | None]
    hint: NotRequired[str | None]
    message: NotRequired[str | None]
    name: NotRequired[str | None]
    labels: dict[str, str]
    spec: Any
    resolved: Any
    progress: ProgressView
    health: HealthView
    warnings: list[FindingView]
    attempt: int
    usage: UsageView
    waiting_for: NotRequired[str | None]
    after: list[str]
    owner: NotRequired[str | None]
    lineage: LineageView
    deterministic: DeterministicView
    created_at: str
    started_at: NotRequired[str | None]
    finished_at: NotRequired[str | None]
    links: dict[str, str]


class Problem(TypedDict):
    """
    An `application/problem+json` body.
    """

    type: str
    title: str
    status: int
    detail: NotRequired[str | None]
    errors: NotRequired[list[ProblemItem]]


class SceneKindList(TypedDict):
    """
    All kinds of scenes.
    """

    items: list[SceneKindView]
    next: NotRequired[str | None]


class StudyList(TypedDict):
    """
    A page of studies.
    """

    items: list[StudyView]
    next: NotRequired[str | None]


class UploadList(TypedDict):
    """
    A page of uploads.
    """

    items: list[UploadView]
    next: NotRequired[str | None]


class JobList(TypedDict):
    """
    A page of jobs.
    """

    items: list[JobView]
    next: NotRequired[str | None]
