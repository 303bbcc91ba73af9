// Studies: what they have come to, speed against error, and the points with their jobs.
import { useEffect, useState } from "preact/hooks";
import { get, openAddress, post, remove, request, Refusal, type Page, type Study } from "../api";
import { listen } from "../events";
import { ago, number } from "../format";
import { useLoaded, useReload } from "../load";
import { Act, Bar, State, Trouble } from "../parts/basics";
import { ErrorPlot, type Line } from "../parts/error-plot";
import { Refinement, type RefinementReport } from "../parts/refinement";
import { go } from "../route";

const REFRESH_MS = 3000;

export function Studies() {
    const { data, error } = useLoaded((signal) => get<Page<Study>>("v1/studies?limit=500", signal), [], REFRESH_MS);
    const studies = data?.items ?? [];
    return (
        <main>
            <header class="title"><h1>Studies</h1><span class="quiet">{data ? studies.length : "loading"}</span></header>
            <Trouble error={error} />
            {data && studies.length === 0 ? <p class="empty">There is no study yet. <a href="#/new">New</a> makes one: “As a study”.</p> : (
                <div class="scroll" tabIndex={0} aria-label="studies"><table>
                    <thead><tr><th scope="col">state</th><th scope="col">done</th><th scope="col">name</th><th scope="col">points</th><th scope="col">axes</th><th scope="col">made</th></tr></thead>
                    <tbody>
                        {studies.map((study) => (
                            <tr key={study.id}>
                                <td><State state={study.state} reason={study.outcome} /></td><td><Bar fraction={study.fraction} /></td>
                                <td class="name"><a href={`#/studies/${study.id}`}>{study.name ?? study.id}</a></td>
                                <td class="figure">{study.points}</td><td>{study.axes.join(", ")}</td><td title={study.created_at}>{ago(study.created_at)}</td>
                            </tr>
                        ))}
                    </tbody>
                </table></div>
            )}
        </main>
    );
}

type Row = Record<string, string | number | boolean | null>;
interface Table { columns: string[]; rows: Row[]; next?: number | null }
interface StudyReport {
    errors?: { quantity: string; norm: string; lines: Line[] }[];
}

async function loadTable(id: string, signal: AbortSignal): Promise<Table> {
    const table: Table = { columns: [], rows: [] };
    let after: number | null | undefined = null;
    do {
        const page: Table = (await (await request(`v1/studies/${id}/table?limit=1000${after === null ? "" : `&after=${after}`}`, { signal })).json()) as Table;
        table.columns = page.columns;
        table.rows.push(...page.rows);
        after = page.next;
    } while (after);
    return table;
}

async function loadReport(id: string, signal: AbortSignal): Promise<StudyReport | null> {
    try {
        return await get<StudyReport>(`v1/studies/${id}/report`, signal);
    } catch (error) {
        if (error instanceof Refusal && error.problem.status === 404) return null;
        throw error;
    }
}

export function StudyPage({ id }: { id: string }) {
    const { data: study, error, reload } = useLoaded((signal) => get<Study>(`v1/studies/${id}`, signal), [id], REFRESH_MS);
    const table = useLoaded((signal) => loadTable(id, signal), [id]);
    const report = useLoaded((signal) => loadReport(id, signal), [id]);
    const isOver = study !== null && study.fraction >= 1;
    useEffect(() => {
        if (isOver) return;
        let timer: number | undefined;
        const stop = listen(`v1/studies/${id}/events`, 0, () => {
            timer ??= window.setTimeout(() => {
                timer = undefined;
                reload();
            }, 500);
        });
        return () => {
            stop();
            window.clearTimeout(timer);
        };
    }, [id, isOver]);
    useReload([table.reload, report.reload], [JSON.stringify(study?.counts)]);
    if (!study) return <main><Trouble error={error} />{!error && <p class="quiet">loading</p>}</main>;
    const act = (action: string) => async () => {
        await post(`v1/studies/${id}/${action}`);
        reload();
    };
    return (
        <main>
            <header class="title">
                <h1>{study.name ?? study.id}</h1><State state={study.state} reason={study.outcome} /><span class="grow" />
                {isOver ? <Act work={act("retry")}>retry what failed</Act> : ["pause", "resume", "cancel"].map((action) => <Act key={action} work={act(action)}>{action}</Act>)}
                <Act work={async () => window.open(await openAddress(`v1/studies/${id}/table`))}>CSV</Act>
                {isOver && <Act kind="danger" work={async () => {
                    if (!confirm("Delete this study, its jobs and all their files?")) return;
                    await remove(`v1/studies/${id}`);
                    go("/studies");
                }}>delete</Act>}
            </header>
            <Trouble error={error} />
            <section class="story">
                <Bar fraction={study.fraction} />
                {study.message && <p class={study.state === "failed" || study.counts.failed ? "message" : "hint"}>{study.message}</p>}
                <dl>{Object.entries(study.counts).filter(([, count]) => count > 0).map(([state, count]) => <><dt>{state}</dt><dd>{count}</dd></>)}</dl>
            </section>
            {report.data && "levels" in report.data && <Refinement report={report.data as RefinementReport} isOver={isOver} />}
            {report.data && <Outcome report={report.data} />}
            {table.data && <Points table={table.data} />}
        </main>
    );
}

function Outcome({ report }: { report: StudyReport }) {
    const errors = report.errors ?? [];
    const [chosen, setChosen] = useState(0);
    const [over, setOver] = useState<"spacing" | "cpu_s">("spacing");
    const shown = errors[Math.min(chosen, errors.length - 1)];
    return (
        <section>
            {shown && (
                <>
                    <h2>Error {over === "spacing" ? "over spacing" : "over CPU time"}</h2>
                    <p class="choices">
                        <label>error of <select value={chosen} onChange={(event) => setChosen(Number(event.currentTarget.value))}>{errors.map((entry, index) => <option key={index} value={index}>{entry.quantity}, {entry.norm}</option>)}</select></label>
                        <label>over <select value={over} onChange={(event) => setOver(event.currentTarget.value as "spacing" | "cpu_s")}><option value="spacing">spacing</option><option value="cpu_s">CPU seconds</option></select></label>
                    </p>
                    <ErrorPlot lines={shown.lines} over={over} name={`${shown.quantity} ${shown.norm}`} />
                    <ul>{shown.lines.map((line) => <li key={line.label}>{line.label || "all points"}: order {number(line.order)}</li>)}</ul>
                </>
            )}
        </section>
    );
}

function Points({ table }: { table: Table }) {
    const columns = table.columns.length > 0 ? table.columns : Object.keys(table.rows[0] ?? {});
    const cell = (row: Row, column: string) => {
        const value = row[column] ?? null;
        if (column === "job" && typeof value === "string") return <a href={`#/jobs/${value}`}>{value.slice(-6)}</a>;
        if (column === "state" && typeof value === "string") return <State state={value} />;
        return typeof value === "number" ? number(value) : value === null ? "–" : String(value);
    };
    return (
        <section>
            <h2>Points</h2>
            <div class="scroll" tabIndex={0}>
                <table>
                    <thead><tr>{columns.map((column) => <th key={column} scope="col">{column}</th>)}</tr></thead>
                    <tbody>{table.rows.map((row, index) => <tr key={index}>{columns.map((column) => <td key={column} class={typeof row[column] === "number" ? "figure" : undefined}>{cell(row, column)}</td>)}</tr>)}</tbody>
                </table>
            </div>
        </section>
    );
}
