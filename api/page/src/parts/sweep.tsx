// A study from a body: which of its values vary, and how.
import { useEffect, useState } from "preact/hooks";
import { create, post, type Study } from "../api";
import { go } from "../route";
import { readNumber, readValues } from "../values";
import { Act } from "./basics";
import { Count, Declared, type DryRun } from "./declared";

interface Axis {
    pointer: string;
    values: string;
}

/** Pointers to all plain values of a body. */
function pointers(of: unknown, at = ""): string[] {
    if (of === null || typeof of !== "object") return at ? [at] : [];
    return Object.entries(of).filter(([key]) => key !== "kind" && key !== "type" && key !== "name").flatMap(([key, inner]) => pointers(inner, `${at}/${key}`));
}

const MODES: Record<string, string> = {
    grid: "a job for every combination of values",
    zip: "a job for the first values of all axes, one for the second ones, and so on",
    list: "a job for each point of a list",
    refine: "levels, each finer than the one before, until a quantity is known to a tolerance",
};

export function Sweep({ body }: { body: Record<string, unknown> }) {
    const [mode, setMode] = useState("grid");
    return (
        <details class="group">
            <summary>As a study</summary>
            <p class="choices"><label>mode <select value={mode} onChange={(event) => setMode(event.currentTarget.value)}>{Object.keys(MODES).map((name) => <option key={name} value={name}>{name}</option>)}</select></label> <span class="doc">{MODES[mode]}</span></p>
            <datalist id="pointers">{pointers(body).map((pointer) => <option key={pointer} value={pointer} />)}</datalist>
            {mode === "grid" || mode === "zip" ? <Axes body={body} mode={mode} /> : <Declared key={mode} body={body} mode={mode} />}
        </details>
    );
}

/** Values of some parameters, combined in one of two ways. */
function Axes({ body, mode }: { body: Record<string, unknown>; mode: string }) {
    const [axes, setAxes] = useState<Axis[]>([{ pointer: "/scene/spacing", values: "" }]);
    const [atOnce, setAtOnce] = useState("");
    const [onFailure, setOnFailure] = useState("");
    const [dry, setDry] = useState<DryRun | null>(null);
    const change = (index: number, part: Partial<Axis>) => setAxes(axes.map((axis, k) => (k === index ? { ...axis, ...part } : axis)));
    const given = axes.filter((axis) => axis.values.trim() && axis.pointer.trim());
    const study = {
        name: body.name,
        base: body,
        sweep: { mode, axes: Object.fromEntries(given.map((axis) => [axis.pointer, readValues(axis.values)])) },
        max_parallel: atOnce.trim() === "" ? undefined : readNumber(atOnce) ?? atOnce,
        on_failure: onFailure || undefined,
    };
    const sent = JSON.stringify(study);
    // A count is of what it was asked for.
    useEffect(() => setDry(null), [sent]);
    return (
        <>
            {axes.map((axis, index) => (
                <div class="axis" key={index}>
                    <input aria-label={`axis ${index + 1}`} list="pointers" value={axis.pointer} onInput={(event) => change(index, { pointer: event.currentTarget.value })} />
                    <input aria-label={`values ${index + 1}`} placeholder="0.05, 0.035, 0.025" value={axis.values} onInput={(event) => change(index, { values: event.currentTarget.value })} />
                    {axes.length > 1 && <button type="button" aria-label={`remove axis ${index + 1}`} onClick={() => setAxes(axes.filter((_, k) => k !== index))}>–</button>}
                </div>
            ))}
            {given.length < axes.length && <p class="doc">An axis counts as soon as it has a pointer and values.</p>}
            <p class="choices">
                <button type="button" onClick={() => setAxes([...axes, { pointer: "", values: "" }])}>another axis</button>
                <label>jobs at once <input class="short" inputMode="numeric" value={atOnce} onInput={(event) => setAtOnce(event.currentTarget.value)} /></label>
                <label>after a failure <select value={onFailure} onChange={(event) => setOnFailure(event.currentTarget.value)}><option value="">default</option><option value="continue">go on</option><option value="stop">stop</option></select></label>
            </p>
            <p class="choices">
                <Act work={async () => setDry(await post<DryRun>("v1/studies?dry_run=true", study))} isOff={given.length === 0}>count</Act>
                <Act kind="primary" work={async () => go(`/studies/${(await create<Study>("v1/studies", study)).id}`)} isOff={given.length === 0}>start the study</Act>
            </p>
            {dry && <Count dry={dry} />}
        </>
    );
}
