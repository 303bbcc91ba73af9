// Two to six jobs beside each other: their series in one plot, their frames with cameras that move together.
import { useEffect, useRef, useState } from "preact/hooks";
import { get, Refusal, type FileEntry, type Job, type Page } from "../api";
import { FrameView } from "../frame/view";
import type { FrameScene } from "../frame/scene";
import { useLoaded } from "../load";
import { State, Trouble } from "../parts/basics";
import { Plot, type Curve } from "../parts/plot";
import type { Series } from "../series";
import { loadSeries, OF_THE_METHOD } from "./job";

const MOST = 6;

interface Member {
    job: Job;
    frames: FileEntry[];
    series: Series | null;
}

async function loadMember(id: string, signal: AbortSignal): Promise<Member> {
    const [job, files, series] = await Promise.all([get<Job>(`v1/jobs/${id}`, signal), get<Page<FileEntry>>(`v1/jobs/${id}/files`, signal), loadSeries(id, signal)]);
    return { job, series, frames: files.items.filter((file) => /^frames\/.*\.vtkhdf$/.test(file.path)) };
}

interface Members {
    members: Member[];
    /** Jobs that are not there, and what the service says of them. */
    refused: { id: string; reason: string }[];
}

async function loadMembers(ids: string[], signal: AbortSignal): Promise<Members> {
    const found = await Promise.allSettled(ids.map((id) => loadMember(id, signal)));
    const refused: Members["refused"] = [];
    for (const [k, one] of found.entries()) {
        if (one.status === "fulfilled") continue;
        if (!(one.reason instanceof Refusal)) throw one.reason;
        refused.push({ id: ids[k] ?? "", reason: one.reason.problem.detail ?? one.reason.problem.title });
    }
    return { members: found.flatMap((one) => (one.status === "fulfilled" ? [one.value] : [])), refused };
}

export function Compare({ ids }: { ids: string[] }) {
    const { data, error } = useLoaded((signal) => loadMembers(ids.slice(0, MOST), signal), [ids.join()]);
    const scenes = useRef(new Map<string, FrameScene>());
    const link = (id: string) => (scene: FrameScene | null) => {
        if (scene) scenes.current.set(id, scene);
        else scenes.current.delete(id);
        const all = [...scenes.current.values()];
        all.forEach((one) => one.link(all));
    };
    const members = data?.members ?? [];
    return (
        <main>
            <header class="title"><h1>Compare</h1><span class="quiet">{members.length} jobs</span></header>
            <Trouble error={error} />
            {ids.length > MOST && <p class="hint" role="status">The first {MOST} of {ids.length} are shown.</p>}
            {data?.refused.map(({ id, reason }) => <p key={id} class="trouble" role="alert"><code>{id}</code> {reason}</p>)}
            {members.length > 0 && <Together members={members} />}
            <div class="beside">
                {members.map(({ job, frames }) => (
                    <section key={job.id}>
                        <h2><a href={`#/jobs/${job.id}`}>{job.name ?? job.id}</a> <State state={job.state} /></h2>
                        {frames.length > 0 ? <FrameView job={job.id} kind={(job.resolved as { scene: { kind: string } }).scene.kind} frames={frames} isRunning={!job.finished_at} onScene={link(job.id)} /> : <p class="empty">This job has no frames.</p>}
                    </section>
                ))}
            </div>
        </main>
    );
}

/** One column of all series, over the times of all. */
function Together({ members }: { members: Member[] }) {
    const names = [...new Set(members.flatMap(({ series }) => series?.names ?? []))].filter((name) => name !== "time" && name !== "step");
    const [chosen, setChosen] = useState<string | null>(null);
    const [logY, setLogY] = useState(false);
    useEffect(() => setChosen(null), [names.join()]);
    const name = chosen ?? names.find((option) => !OF_THE_METHOD.test(option)) ?? names[0];
    if (!name) return <p class="empty">These jobs have no series.</p>;
    const times = [...new Set(members.flatMap(({ series }) => (series?.columns.time ?? []).filter((time): time is number => time !== null)))].sort((a, b) => a - b);
    const curves: Curve[] = members.map(({ job, series }) => {
        const at = new Map((series?.columns.time ?? []).map((time, row) => [time, series?.columns[name]?.[row] ?? null]));
        return { label: job.name ?? job.id.slice(-6), values: times.map((time) => at.get(time) ?? null) };
    });
    return (
        <section>
            <p class="choices">
                <label>series <select value={name} onChange={(event) => setChosen(event.currentTarget.value)}>{names.map((option) => <option key={option} value={option}>{option}</option>)}</select></label>
                <label><input type="checkbox" checked={logY} onChange={() => setLogY(!logY)} /> logarithmic values</label>
            </p>
            <Plot x={times} xLabel="time" curves={curves} logY={logY} label={`${name} of all jobs over time`} />
        </section>
    );
}
