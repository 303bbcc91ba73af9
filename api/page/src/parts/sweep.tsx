// A study from a body: which of its values vary, and how.
import { useState } from "preact/hooks";
import { post, type Study } from "../api";
import { bytes, number, seconds } from "../format";
import { Act } from "./basics";
import { go } from "../route";

interface Axis {
    pointer: string;
    values: string;
}

interface DryRun {
    points: unknown[];
    estimate: { particles?: number; memory_bytes?: number; disk_bytes?: number; cpu_s?: number | null };
}

/** Pointers to all plain values of a body. */
function pointers(of: unknown, at = ""): string[] {
    if (of === null || typeof of !== "object") return at ? [at] : [];
    return Object.entries(of).filter(([key]) => key !== "kind" && key !== "type" && key !== "name").flatMap(([key, inner]) => pointers(inner, `${at}/${key}`));
}

/** Values as written: JSON where it is, else words between commas. */
function read(text: string): unknown[] {
    return text.split(",").map((part) => part.trim()).filter(Boolean).map((part) => {
        try {
            return JSON.parse(part) as unknown;
        } catch {
            return part;
        }
    });
}

export function Sweep({ body }: { body: Record<string, unknown> }) {
    const known = pointers(body);
    const [axes, setAxes] = useState<Axis[]>([{ pointer: "/scene/spacing", values: "" }]);
    const [mode, setMode] = useState("grid");
    const [dry, setDry] = useState<DryRun | null>(null);
    const change = (index: number, part: Partial<Axis>) => {
        setAxes(axes.map((axis, k) => (k === index ? { ...axis, ...part } : axis)));
        setDry(null);
    };
    const study = () => ({
        name: body.name,
        base: body,
        sweep: { mode, axes: Object.fromEntries(axes.filter((axis) => axis.values.trim()).map((axis) => [axis.pointer, read(axis.values)])) },
    });
    return (
        <details class="group">
            <summary>As a study</summary>
            <p class="doc">A job for every combination of values (grid), or for the first values of all axes, the second ones, and so on (zip).</p>
            <datalist id="pointers">{known.map((pointer) => <option key={pointer} value={pointer} />)}</datalist>
            {axes.map((axis, index) => (
                <div class="axis" key={index}>
                    <input aria-label={`axis ${index + 1}`} list="pointers" value={axis.pointer} onInput={(event) => change(index, { pointer: event.currentTarget.value })} />
                    <input aria-label={`values ${index + 1}`} placeholder="0.05, 0.035, 0.025" value={axis.values} onInput={(event) => change(index, { values: event.currentTarget.value })} />
                    {axes.length > 1 && <button type="button" aria-label={`remove axis ${index + 1}`} onClick={() => setAxes(axes.filter((_, k) => k !== index))}>–</button>}
                </div>
            ))}
            <p class="choices">
                <button type="button" onClick={() => setAxes([...axes, { pointer: "", values: "" }])}>another axis</button>
                <label>mode <select value={mode} onChange={(event) => { setMode(event.currentTarget.value); setDry(null); }}><option value="grid">grid</option><option value="zip">zip</option></select></label>
                <Act work={async () => setDry(await post<DryRun>("v1/studies?dry_run=true", study()))}>count</Act>
                <Act kind="primary" work={async () => go(`/studies/${(await post<Study>("v1/studies", study())).id}`)}>start the study</Act>
            </p>
            {dry && <p role="status">{number(dry.points.length)} points, {seconds(dry.estimate.cpu_s)} of CPU time, {bytes(dry.estimate.disk_bytes)} of disk.</p>}
        </details>
    );
}
