// One job: what it does, whether it can be trusted, its frames, its series, what it cost, and what can be made of it.
import { useEffect, useState } from "preact/hooks";
import { create, get, openAddress, post, remove, request, Refusal, type Checkpoint, type FileEntry, type Job, type Page, type Report } from "../api";
import { listen } from "../events";
import { ago, bytes, curl, number, seconds } from "../format";
import { FrameView } from "../frame/view";
import { useLoaded, useReload } from "../load";
import { Act, actionsOf, Bar, Copy, Findings, Health, State, Trouble } from "../parts/basics";
import { Plot } from "../parts/plot";
import { readSeries, type Series } from "../series";
import { go } from "../route";
import { readValue } from "../values";

const REFRESH_MS = 5000;

/** What is small follows every event, what may be long (files, series, log) comes now and then. */
const SOON_MS = 150;
const SLOWLY_MS = 2000;

/** Counts changes of a job, by its events: at once, and slowly. */
function useChanges(id: string, job: Job | null): { changes: number; slow: number } {
    const [changes, setChanges] = useState(0);
    const [slow, setSlow] = useState(0);
    const isOver = job !== null && job.finished_at !== null && job.finished_at !== undefined;
    useEffect(() => {
        if (isOver) return;
        let soon: number | undefined;
        let later: number | undefined;
        // Many events in a moment are one change of the page.
        const change = () => {
            soon ??= window.setTimeout(() => {
                soon = undefined;
                setChanges((count) => count + 1);
            }, SOON_MS);
            later ??= window.setTimeout(() => {
                later = undefined;
                setSlow((count) => count + 1);
            }, SLOWLY_MS);
        };
        const stop = listen(`v1/jobs/${id}/events`, 0, change);
        return () => {
            stop();
            window.clearTimeout(soon);
            window.clearTimeout(later);
        };
    }, [id, isOver]);
    return { changes, slow };
}

export function JobPage({ id }: { id: string }) {
    const [watched, setWatched] = useState<Job | null>(null);
    const { changes, slow } = useChanges(id, watched);
    const { data: job, error, reload } = useLoaded((signal) => get<Job>(`v1/jobs/${id}`, signal), [id], watched?.finished_at ? 0 : REFRESH_MS);
    useReload([reload], [changes]);
    useEffect(() => setWatched(job), [job?.id, job?.finished_at]);
    const files = useLoaded((signal) => get<Page<FileEntry>>(`v1/jobs/${id}/files`, signal), [id]);
    const series = useLoaded((signal) => loadSeries(id, signal), [id]);
    useReload([files.reload, series.reload], [slow, job?.finished_at]);
    // It may have been deleted elsewhere while it was shown.
    if (error instanceof Refusal && error.problem.status === 404) return <main><Trouble error={error} /><p><a href="#/jobs">all jobs</a></p></main>;
    if (!job) return <main><Trouble error={error} />{!error && <p class="quiet">loading</p>}</main>;
    const frames = (files.data?.items ?? []).filter((file) => /^frames\/.*\.vtkhdf$/.test(file.path));
    const kind = (job.resolved as { scene?: { kind?: string } } | null)?.scene?.kind ?? "";
    return (
        <main>
            <header class="title">
                <h1>{job.name ?? job.id}</h1>
                <State state={job.state} reason={job.state === "succeeded" ? null : job.reason} />
                <Health status={job.health.status} />
                <span class="grow" />
                {actionsOf(job).map((action) => (
                    <Act key={action} work={async () => {
                        const made = await post<Job>(`v1/jobs/${id}/${action}`);
                        if (action === "retry") go(`/jobs/${made.id}`);
                        else reload();
                    }}>{action}</Act>
                ))}
                {job.finished_at && <Act kind="danger" work={async () => {
                    if (!confirm("Delete this job and all its files?")) return;
                    await remove(`v1/jobs/${id}`);
                    go("/jobs");
                }}>delete</Act>}
            </header>
            <Trouble error={error} />
            <Story job={job} />
            <div class="columns">
                <section class="wide">
                    <h2>Frames</h2>
                    {frames.length > 0
                        ? <FrameView job={id} kind={kind} frames={frames} isRunning={!job.finished_at} />
                        : <p class="empty">{job.finished_at ? "This job has no frames." : "The first frame comes when the run begins."}</p>}
                </section>
                <section>
                    <h2>Series</h2>
                    <SeriesPlot job={id} series={series.data} />
                </section>
                <section>
                    <h2>Checks and findings</h2>
                    <Checks job={job} />
                </section>
                {job.state === "succeeded" && <section><h2>Errors and cost</h2><ReportTable id={id} /></section>}
                <section>
                    <h2>Checkpoints and files</h2>
                    <Checkpoints job={job} changes={slow} />
                    <Files id={id} files={files.data?.items ?? []} />
                </section>
                <section>
                    <h2>Body</h2>
                    <p class="choices"><Copy text={curl("v1/jobs", job.spec)}>copy as curl</Copy> <a class="button" href={`#/new?like=${id}`}>edit as a new job (fork)</a></p>
                    <pre>{JSON.stringify(job.spec, null, 2)}</pre>
                    <details><summary>with all defaults</summary><pre>{JSON.stringify(job.resolved, null, 2)}</pre></details>
                </section>
                <section>
                    <h2>Log</h2>
                    <Log id={id} changes={slow} isOver={Boolean(job.finished_at)} />
                </section>
            </div>
        </main>
    );
}

function Story({ job }: { job: Job }) {
    const { progress, usage } = job;
    return (
        <section class="story">
            <Bar fraction={progress.fraction} />
            {job.message && <p class="message">{job.message}</p>}
            {job.hint && <p class="hint">{job.hint}</p>}
            {job.waiting_for && <p class="hint">Waits for {job.waiting_for}.</p>}
            <dl>
                <dt>time</dt><dd>{number(progress.time)} of {number(progress.end_time)}</dd>
                <dt>step</dt><dd>{number(progress.step)}</dd>
                <dt>phase</dt><dd>{progress.phase || "–"}</dd>
                <dt>remaining</dt><dd>{seconds(progress.eta_s)}</dd>
                <dt>speed</dt><dd>{progress.steps_per_s ? `${number(progress.steps_per_s)} steps/s` : "–"}</dd>
                <dt>particles</dt><dd>{number(progress.particles)}</dd>
                <dt>CPU</dt><dd>{seconds(usage.cpu_s)}</dd>
                <dt>running</dt><dd>{seconds(usage.wall_s)}</dd>
                <dt>memory</dt><dd>{bytes(usage.peak_memory_bytes)}</dd>
                <dt>disk</dt><dd>{bytes(usage.disk_bytes)}</dd>
                <dt>made</dt><dd title={job.created_at}>{ago(job.created_at)}</dd>
                <dt>attempt</dt><dd>{job.attempt}</dd>
                {job.lineage.study && <><dt>study</dt><dd><a href={`#/studies/${job.lineage.study}`}>{job.lineage.study}</a></dd></>}
                {job.lineage.restarted_from && <><dt>restarted from</dt><dd><Source checkpoint={job.lineage.restarted_from} /></dd></>}
                {job.lineage.retry_of && <><dt>retry of</dt><dd><a href={`#/jobs/${job.lineage.retry_of}`}>{job.lineage.retry_of}</a></dd></>}
            </dl>
        </section>
    );
}

/** A checkpoint, with the job that wrote it. */
function Source({ checkpoint }: { checkpoint: string }) {
    const { data } = useLoaded((signal) => get<Checkpoint>(`v1/checkpoints/${checkpoint}`, signal), [checkpoint]);
    return data?.job ? <a href={`#/jobs/${data.job}`}>{checkpoint}</a> : <>{checkpoint}</>;
}

export async function loadSeries(id: string, signal: AbortSignal): Promise<Series | null> {
    try {
        const answer = await request(`v1/jobs/${id}/series`, { accept: "text/csv", signal });
        return readSeries(await answer.text());
    } catch (error) {
        if (error instanceof Refusal && error.problem.status === 404) return null;
        throw error;
    }
}

const HIDDEN_COLUMNS = new Set(["step", "time"]);
/** Columns that tell of the method, not of the physics: not shown at first. */
export const OF_THE_METHOD = /^(time_step|cfl|band_particles|rescued_fits|unresolved|swept|kept)$/;
const SHOWN_AT_FIRST = 2;

export function SeriesPlot({ job, series }: { job: string; series: Series | null }) {
    const [chosen, setChosen] = useState<string[] | null>(null);
    const [logX, setLogX] = useState(false);
    const [logY, setLogY] = useState(false);
    if (!series || series.rows === 0) return <p class="empty">No row yet.</p>;
    const names = series.names.filter((name) => !HIDDEN_COLUMNS.has(name));
    const columns = chosen ?? (names.some((name) => !OF_THE_METHOD.test(name)) ? names.filter((name) => !OF_THE_METHOD.test(name)) : names).slice(0, SHOWN_AT_FIRST);
    const toggle = (name: string) => setChosen(columns.includes(name) ? columns.filter((other) => other !== name) : [...columns, name]);
    const curves = columns.map((name) => ({ label: name, values: series.columns[name] ?? [] }));
    return (
        <>
            <Plot x={(series.columns.time ?? []).map((value) => value ?? Number.NaN)} xLabel="time" curves={curves} logX={logX} logY={logY} label={`${columns.join(", ")} over time`} />
            <fieldset class="choices">
                <legend class="unseen">columns</legend>
                {names.map((name) => <label key={name}><input type="checkbox" checked={columns.includes(name)} onChange={() => toggle(name)} /> {name}</label>)}
            </fieldset>
            <p class="choices">
                <label><input type="checkbox" checked={logX} onChange={() => setLogX(!logX)} /> logarithmic time</label>
                <label><input type="checkbox" checked={logY} onChange={() => setLogY(!logY)} /> logarithmic values</label>
                <Act work={async () => window.open(await openAddress(`v1/jobs/${job}/series`))}>CSV</Act>
            </p>
        </>
    );
}

function Checks({ job }: { job: Job }) {
    const { checks, findings } = job.health;
    return (
        <>
            <Findings findings={[...job.warnings, ...findings]} />
            {checks.length === 0 ? <p class="quiet">No check yet.</p> : (
                <table>
                    <thead><tr><th scope="col">check</th><th scope="col">value</th><th scope="col">limit</th><th scope="col">holds</th></tr></thead>
                    <tbody>
                        {checks.map((check) => (
                            <tr key={check.name}>
                                <th scope="row">{check.name}</th>
                                <td class="figure">{number(check.value)} {check.unit}</td>
                                <td class="figure">{number(check.limit)}</td>
                                <td>{check.holds === null || check.holds === undefined ? "–" : check.holds ? "✓ yes" : "✕ no"}</td>
                            </tr>
                        ))}
                    </tbody>
                </table>
            )}
        </>
    );
}

function ReportTable({ id }: { id: string }) {
    const { data: report, error } = useLoaded((signal) => get<Report>(`v1/jobs/${id}/report`, signal), [id]);
    if (!report) return <Trouble error={error} />;
    const phases = Object.entries(report.cost.phases).sort((a, b) => b[1] - a[1]);
    const all = phases.reduce((sum, [, value]) => sum + value, 0);
    return (
        <>
            {report.errors.length > 0 && (
                <table>
                    <thead><tr><th scope="col">quantity</th><th scope="col">norm</th><th scope="col">error</th><th scope="col">time</th></tr></thead>
                    <tbody>
                        {report.errors.map((entry) => (
                            <tr key={`${entry.quantity}-${entry.norm}-${entry.time}`}><th scope="row">{entry.quantity}</th><td>{entry.norm}</td><td class="figure">{number(entry.value)}</td><td class="figure">{number(entry.time)}</td></tr>
                        ))}
                    </tbody>
                </table>
            )}
            <p>{seconds(report.cost.cpu_s)} of CPU time in {number(report.cost.steps)} steps, {bytes(report.cost.peak_memory_bytes)}</p>
            <table>
                <thead><tr><th scope="col">phase</th><th scope="col">CPU</th><th scope="col">share</th></tr></thead>
                <tbody>{phases.map(([name, value]) => <tr key={name}><th scope="row">{name}</th><td class="figure">{seconds(value)}</td><td><Bar fraction={all > 0 ? value / all : 0} label={`share of ${name}`} /></td></tr>)}</tbody>
            </table>
        </>
    );
}

function Checkpoints({ job, changes }: { job: Job; changes: number }) {
    const { data, reload } = useLoaded((signal) => get<Page<Checkpoint>>(`v1/jobs/${job.id}/checkpoints`, signal), [job.id]);
    const [chosen, setChosen] = useState<string | null>(null);
    useReload([reload], [changes, job.finished_at]);
    const checkpoints = data?.items ?? [];
    return (
        <>
            {job.state === "running" && <Act work={() => post(`v1/jobs/${job.id}/checkpoints`)}>checkpoint now</Act>}
            {checkpoints.length > 0 && (
                <table>
                    <thead><tr><th scope="col">step</th><th scope="col">time</th><th scope="col">size</th><th scope="col"><span class="unseen">actions</span></th></tr></thead>
                    <tbody>
                        {checkpoints.map((checkpoint) => (
                            <tr key={checkpoint.id}>
                                <td class="figure">{number(checkpoint.step)}</td><td class="figure">{number(checkpoint.time)}</td><td class="figure">{bytes(checkpoint.size_bytes)}</td>
                                <td>
                                    <Act work={async () => window.open(await openAddress(`v1/checkpoints/${checkpoint.id}/content`))}>download</Act>
                                    <button type="button" onClick={() => setChosen(chosen === checkpoint.id ? null : checkpoint.id)}>restart</button>
                                </td>
                            </tr>
                        ))}
                    </tbody>
                </table>
            )}
            {chosen && <Restart job={job} checkpoint={chosen} />}
        </>
    );
}

/** A job that goes on from a checkpoint, with the fields that may change. */
function Restart({ job, checkpoint }: { job: Job; checkpoint: string }) {
    const scene = (job.resolved as { scene: Record<string, unknown> }).scene;
    const { data: kind } = useLoaded((signal) => get<{ restart_safe: string[] }>(`v1/scenes/${String(scene.kind)}`, signal), [scene.kind]);
    const [values, setValues] = useState<Record<string, string>>({});
    const at = (pointer: string): unknown => pointer.split("/").slice(1).reduce<unknown>((value, key) => (value as Record<string, unknown> | null)?.[key], scene);
    const submit = async () => {
        const given = Object.entries(values).filter(([, text]) => text !== "");
        const overrides = Object.fromEntries(given.map(([pointer, text]) => [pointer, readValue(text)]));
        // All of the body goes over but what the checkpoint has.
        const { scene: _, restart: __, accuracy: ___, after: ____, ...rest } = job.spec as Record<string, unknown>;
        const made = await create<Job>("v1/jobs", { ...rest, restart: { checkpoint, overrides } });
        go(`/jobs/${made.id}`);
    };
    return (
        <form class="restart" onSubmit={(event) => event.preventDefault()}>
            <p>Goes on from <code>{checkpoint}</code>. What may change:</p>
            {(kind?.restart_safe ?? []).map((pointer) => (
                <label key={pointer}>
                    <code>{pointer}</code>{" "}
                    <input name={pointer} placeholder={JSON.stringify(at(pointer)) ?? ""} value={values[pointer] ?? ""} onInput={(event) => setValues({ ...values, [pointer]: event.currentTarget.value })} />
                </label>
            ))}
            <Act kind="primary" work={submit}>start</Act>
        </form>
    );
}

function Files({ id, files }: { id: string; files: FileEntry[] }) {
    if (files.length === 0) return null;
    const open = (path: string) => async () => window.open(await openAddress(path));
    return (
        <details>
            <summary>{files.length} files, {bytes(files.reduce((sum, file) => sum + file.size_bytes, 0))}</summary>
            <p><Act work={open(`v1/jobs/${id}/files.tar`)}>all as one archive</Act></p>
            <table>
                <tbody>{files.map((file) => <tr key={file.path}><td><Act kind="link" work={open(`v1/jobs/${id}/files/${file.path}`)}>{file.path}</Act></td><td class="figure">{bytes(file.size_bytes)}</td></tr>)}</tbody>
            </table>
        </details>
    );
}

const LINES = 40;

function Log({ id, changes, isOver }: { id: string; changes: number; isOver: boolean }) {
    const { data, reload } = useLoaded(async (signal) => (await request(`v1/jobs/${id}/log?tail=${LINES}`, { accept: "text/plain", signal })).text(), [id]);
    useReload([reload], [changes, isOver]);
    return <pre class="log" tabIndex={0}>{data ?? ""}</pre>;
}
