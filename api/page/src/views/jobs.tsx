// All jobs: a table that follows the service, with the filters of the API in its address.
import { useMemo, useRef, useState } from "preact/hooks";
import { get, post, type Job, type Page, type SceneKind } from "../api";
import { ago, seconds } from "../format";
import { useLoaded } from "../load";
import { Act, Bar, Health, State, Trouble } from "../parts/basics";
import { setQuery, type Route } from "../route";

const STATES = ["queued", "running", "pausing", "paused", "canceling", "interrupted", "succeeded", "failed", "canceled"];
const ROW_PX = 38;
const SPARE_ROWS = 12;
const PAGE = 500;
const MOST = 20_000;
const REFRESH_MS = 2000;
const MOST_COMPARED = 6;
/** Filters with a field of their own; others come by an address. */
const FIELDS = ["state", "kind", "health", "name"];
/** What an address may say of the list beside filters. */
const OF_LISTS = ["sort", "limit", "cursor"];

/** What a view of jobs is filtered by: whatever its address says, so that the service judges it. */
const filtersOf = (route: Route): string[] => [...new Set(route.query.keys())].filter((name) => !OF_LISTS.includes(name) && route.query.get(name));

/** What an action on many jobs came to. */
interface Acted {
    matched: number;
    changed: number;
    skipped: { job: string; reason: string }[];
}

/** The newest jobs that the filters let through; further pages as long as there are any. */
async function loadAll(query: string, known: Job[], signal: AbortSignal): Promise<Job[]> {
    const found: Job[] = [];
    let cursor: string | number | null | undefined = null;
    do {
        const part: string = cursor === null ? "" : `&cursor=${encodeURIComponent(String(cursor))}`;
        const page: Page<Job> = await get<Page<Job>>(`v1/jobs?limit=${PAGE}${query}${part}`, signal);
        found.push(...page.items);
        cursor = page.next;
        // What has ended does not change: the rest is as it was.
        const last = page.items.at(-1);
        if (last && cursor) {
            const at = known.findIndex((job) => job.id === last.id);
            if (at >= 0 && known.slice(at).every((job) => job.finished_at)) return [...found, ...known.slice(at + 1)];
        }
    } while (cursor && found.length < MOST);
    return found;
}

export function Jobs({ route }: { route: Route }) {
    const filters = filtersOf(route);
    const query = [...filters, ...(route.query.get("sort") ? ["sort"] : [])].map((name) => `&${name}=${encodeURIComponent(route.query.get(name) ?? "")}`).join("");
    const known = useRef<{ query: string; jobs: Job[] }>({ query: "", jobs: [] });
    const { data, error, reload } = useLoaded(async (signal) => {
        const jobs = await loadAll(query, known.current.query === query ? known.current.jobs : [], signal);
        known.current = { query, jobs };
        return jobs;
    }, [query], REFRESH_MS);
    const [selected, setSelected] = useState<Set<string>>(new Set());
    const jobs = data ?? [];
    // A job that is gone can be compared no more.
    const listed = new Set(jobs.map((job) => job.id));
    const compared = [...selected].filter((id) => listed.has(id));
    const toggle = (id: string) => {
        const next = new Set(selected);
        if (!next.delete(id)) next.add(id);
        setSelected(next);
    };
    return (
        <main>
            <header class="title">
                <h1>Jobs</h1>
                <span class="quiet" role="status">{data ? `${jobs.length.toLocaleString("en")}${jobs.length >= MOST ? " newest" : ""}` : "loading"}</span>
                <span class="grow" />
                {compared.length > MOST_COMPARED && <span class="quiet" role="status">{compared.length} chosen; {MOST_COMPARED} can be compared</span>}
                {compared.length >= 2 && compared.length <= MOST_COMPARED && <a class="button" href={`#/compare/${compared.join(",")}`}>Compare {compared.length}</a>}
                <a class="button primary" href="#/new">New job</a>
            </header>
            <Filters route={route} />
            <Trouble error={error} />
            <Bulk key={query} filters={filters} route={route} count={jobs.length} onDone={reload} />
            {data && jobs.length === 0 ? <Nothing isFiltered={filters.length > 0} /> : <Table jobs={jobs} selected={selected} toggle={toggle} />}
        </main>
    );
}

function Nothing({ isFiltered }: { isFiltered: boolean }) {
    return isFiltered ? <p class="empty">No job is like that.</p> : <p class="empty">There is no job yet. <a href="#/new">Make the first one</a>.</p>;
}

function Filters({ route }: { route: Route }) {
    const { data: kinds } = useLoaded((signal) => get<Page<SceneKind>>("v1/scenes", signal), []);
    const choice = (name: string, values: string[]) => (
        <label>
            {name}{" "}
            <select value={route.query.get(name) ?? ""} onChange={(event) => setQuery(route, { [name]: event.currentTarget.value })}>
                <option value="">any</option>
                {values.map((value) => <option key={value} value={value}>{value}</option>)}
            </select>
        </label>
    );
    return (
        <form class="filters" onSubmit={(event) => event.preventDefault()}>
            {choice("state", STATES)}
            {choice("kind", (kinds?.items ?? []).map(({ kind }) => kind))}
            {choice("health", ["sound", "doubtful"])}
            {filtersOf(route).filter((name) => !FIELDS.includes(name)).map((name) => (
                <button key={name} type="button" class="label" title="take this filter away" onClick={() => setQuery(route, { [name]: null })}>{name}: {route.query.get(name)} ×</button>
            ))}
            <label>
                name{" "}
                <input type="search" value={route.query.get("name") ?? ""} onChange={(event) => setQuery(route, { name: event.currentTarget.value })} />
            </label>
        </form>
    );
}

/** Acts on all that the filters let through, after it has told how many that are. */
function Bulk({ filters, route, count, onDone }: { filters: string[]; route: Route; count: number; onDone: () => void }) {
    const [planned, setPlanned] = useState<{ action: string; filter: object; matched: number; changed: number } | null>(null);
    const [done, setDone] = useState<Acted | null>(null);
    if (filters.length === 0 || (count === 0 && !done)) return null;
    const ask = (action: string) => async () => {
        setDone(null);
        const filter = Object.fromEntries(filters.map((name) => [name, route.query.get(name)]));
        setPlanned({ action, filter, ...(await post<Acted>("v1/jobs/actions", { action, filter, dry_run: true })) });
    };
    return (
        <div class="bulk">
            <span class="quiet">All of these:</span>
            {["pause", "resume", "cancel", "delete"].map((action) => <Act key={action} work={ask(action)}>{action}</Act>)}
            {planned && (
                <span class="confirm" role="alertdialog" aria-label="confirm">
                    {planned.changed < planned.matched ? `${planned.changed} of ${planned.matched} jobs let you ${planned.action} them. ` : ""}
                    {planned.action} {planned.changed} {planned.changed === 1 ? "job" : "jobs"}?{" "}
                    {planned.changed > 0 && <Act kind="danger" work={async () => {
                        setDone(await post<Acted>("v1/jobs/actions", { action: planned.action, filter: planned.filter, dry_run: false }));
                        setPlanned(null);
                        onDone();
                    }}>yes, {planned.action}</Act>}
                    <button type="button" onClick={() => setPlanned(null)}>no</button>
                </span>
            )}
            {done && <span role="status">{done.changed} done{done.skipped.length > 0 && `, ${done.skipped.length} left as they were: ${[...new Set(done.skipped.map((one) => one.reason))].join("; ")}`}</span>}
        </div>
    );
}

/** Only the rows that are seen are in the document: ten thousand scroll as ten do. */
function Table({ jobs, selected, toggle }: { jobs: Job[]; selected: Set<string>; toggle: (id: string) => void }) {
    const [top, setTop] = useState(0);
    const [height, setHeight] = useState(600);
    const first = Math.max(0, Math.floor(top / ROW_PX) - SPARE_ROWS);
    const last = Math.min(jobs.length, Math.ceil((top + height) / ROW_PX) + SPARE_ROWS);
    const rows = useMemo(() => jobs.slice(first, last), [jobs, first, last]);
    const measure = (place: HTMLDivElement | null) => {
        if (place && place.clientHeight !== height) setHeight(place.clientHeight);
    };
    return (
        <div class="scroll" ref={measure} onScroll={(event) => setTop(event.currentTarget.scrollTop)} tabIndex={0} aria-label="jobs">
            <table class="jobs" aria-rowcount={jobs.length}>
                <thead>
                    <tr><th scope="col"><span class="unseen">compare</span></th><th scope="col">state</th><th scope="col">progress</th><th scope="col">kind</th><th scope="col">name</th><th scope="col">health</th><th scope="col">CPU</th><th scope="col">made</th></tr>
                </thead>
                <tbody>
                    {first > 0 && <tr style={{ height: `${first * ROW_PX}px` }} aria-hidden="true" />}
                    {rows.map((job, index) => <Row key={job.id} job={job} index={first + index + 1} isSelected={selected.has(job.id)} toggle={toggle} />)}
                    {last < jobs.length && <tr style={{ height: `${(jobs.length - last) * ROW_PX}px` }} aria-hidden="true" />}
                </tbody>
            </table>
        </div>
    );
}

function Row({ job, index, isSelected, toggle }: { job: Job; index: number; isSelected: boolean; toggle: (id: string) => void }) {
    const kind = (job.resolved as { scene?: { kind?: string } } | null)?.scene?.kind ?? (job.spec as { scene?: { kind?: string } })?.scene?.kind ?? "";
    const doubt = job.health.status === "sound" ? undefined : job.health.findings.find(({ severity }) => severity === "warning");
    return (
        <tr aria-rowindex={index}>
            <td><input type="checkbox" checked={isSelected} onChange={() => toggle(job.id)} aria-label={`compare ${job.name ?? job.id}`} /></td>
            <td><State state={job.state} reason={job.state === "succeeded" ? null : job.reason} /></td>
            <td>
                <Bar fraction={job.progress.fraction} />
                {job.progress.eta_s ? <span class="quiet"> {seconds(job.progress.eta_s)}</span> : null}
            </td>
            <td>{kind}</td>
            <td class="name"><a href={`#/jobs/${job.id}`}>{job.name ?? job.id}</a>{Object.entries(job.labels).map(([key, value]) => <span key={key} class="label">{key}: {value}</span>)}</td>
            <td title={doubt?.message}><Health status={job.health.status} why={doubt?.code} /></td>
            <td class="figure">{seconds(job.usage.cpu_s)}</td>
            <td title={job.created_at}>{ago(job.created_at)}</td>
        </tr>
    );
}
