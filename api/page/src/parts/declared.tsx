// A study of a mode whose parameters make a form of their own, as the service declares them.
import { useEffect, useState } from "preact/hooks";
import { create, post, Refusal, type Problem, type Study } from "../api";
import { schemaOf } from "../description";
import { bytes, number, seconds } from "../format";
import { useLoaded } from "../load";
import { go } from "../route";
import { withValue } from "../values";
import { Act, Trouble } from "./basics";
import { Parameter, type Schema } from "./form";

export interface DryRun {
    points: unknown[];
    estimate: { particles?: number; memory_bytes?: number; disk_bytes?: number; cpu_s?: number | null };
}

/** What a dry run says. */
export function Count({ dry }: { dry: DryRun }) {
    return <p role="status">{number(dry.points.length)} {dry.points.length === 1 ? "point" : "points"}, {seconds(dry.estimate.cpu_s)} of CPU time, {bytes(dry.estimate.disk_bytes)} of disk.</p>;
}

async function loadSweep(mode: string): Promise<Schema> {
    const sweep = (await schemaOf("StudySpec")).properties?.sweep;
    const declared = (sweep?.anyOf ?? sweep?.oneOf ?? []).find(({ properties }) => properties?.mode?.const === mode);
    const { mode: _, ...properties } = declared?.properties ?? {};
    return { ...declared, description: undefined, properties };
}

/** What a mode begins with. */
function start(mode: string, body: Record<string, unknown>): Record<string, unknown> {
    const spacing = (body.scene as { spacing?: unknown } | undefined)?.spacing;
    return mode === "refine" ? { mode, axis: "/scene/spacing", from: typeof spacing === "number" ? spacing : 0.1, quantity: { error: {} }, until: {} } : { mode };
}

export function Declared({ body, mode }: { body: Record<string, unknown>; mode: string }) {
    const { data: schema, error } = useLoaded(() => loadSweep(mode), [mode]);
    const [sweep, setSweep] = useState(() => start(mode, body));
    const [dry, setDry] = useState<DryRun | null>(null);
    const [problem, setProblem] = useState<Problem | null>(null);
    const study = { name: body.name, base: body, sweep };
    const sent = JSON.stringify(study);
    // What was said is of what was asked.
    useEffect(() => {
        setDry(null);
        setProblem(null);
    }, [sent]);
    const said = async <T,>(asked: Promise<T>): Promise<T> => {
        try {
            return await asked;
        } catch (failed) {
            if (failed instanceof Refusal) setProblem(failed.problem);
            throw failed;
        }
    };
    const set = (pointer: string[], value: unknown) => setSweep((now) => withValue(now, pointer.slice(1), value) as Record<string, unknown>);
    const errorsAt = (pointer: string) => (problem?.errors ?? []).filter((item) => item.pointer === pointer);
    return (
        <>
            <Trouble error={error} />
            {schema && <Parameter name={mode} schema={schema} value={sweep} pointer={["sweep"]} set={set} errorsAt={errorsAt} isOpen />}
            <p class="choices">
                <Act work={async () => setDry(await said(post<DryRun>("v1/studies?dry_run=true", study)))}>count</Act>
                <Act kind="primary" work={async () => go(`/studies/${(await said(create<Study>("v1/studies", study))).id}`)}>start the study</Act>
            </p>
            {dry && <Count dry={dry} />}
        </>
    );
}
