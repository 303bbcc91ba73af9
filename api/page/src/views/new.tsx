// A new job: a form made from the schema of its scene, beside the body as JSON; either can be edited, and the service says of both
// what it thinks.
import { useEffect, useRef, useState } from "preact/hooks";
import { get, post, Refusal, request, type Estimate, type Job, type Problem, type SceneKind, type Upload } from "../api";
import { bytes, curl, number, seconds } from "../format";
import { useLoaded } from "../load";
import { Act, Copy, Findings, Trouble } from "../parts/basics";
import { Parameter, type Schema } from "../parts/form";
import { Sweep } from "../parts/sweep";
import { go, type Route } from "../route";

type Body = { scene: Record<string, unknown> } & Record<string, unknown>;

const KINDS: [string, string][] = [
    ["vortex", "an interface in a flow"],
    ["droplet", "a droplet of two fluids"],
    ["front", "a moving front"],
    ["surface_pde", "an equation on a surface"],
    ["redistance", "distances from a surface"],
];

const ESTIMATE_PAUSE_MS = 350;

/** Fields of a body beside its scene. */
const RUN: Schema = {
    type: "object",
    properties: {
        name: { type: "string", description: "name, for people" },
        output: { type: "object", properties: {
            every_time: { type: "number", exclusiveMinimum: 0, description: "a frame at every multiple of this time; first and last only when not given" },
            series_every_steps: { type: "integer", minimum: 1, default: 10, description: "a series row every so many steps" },
        }, description: "what to write" },
        limits: { type: "object", properties: {
            threads: { type: "integer", minimum: 1, description: "threads of the worker" },
            wall_s: { type: "number", exclusiveMinimum: 0, description: "running time until the job is paused, in seconds" },
        }, description: "limits of the job" },
        priority: { type: "integer", default: 0, description: "higher goes first; a unit is worth ten minutes of waiting" },
    },
};

export function New({ route }: { route: Route }) {
    const like = route.query.get("like");
    const [body, setBody] = useState<Body | null>(null);
    const [text, setText] = useState("");
    const [textError, setTextError] = useState<string | null>(null);
    const kind = String(body?.scene.kind ?? "");
    const { data: scene, error } = useLoaded<SceneKind | null>(async (signal) => (kind ? get<SceneKind>(`v1/scenes/${kind}`, signal) : null), [kind]);

    const begin = (next: Body) => {
        setBody(next);
        setText(JSON.stringify(next, null, 2));
        setTextError(null);
    };
    useEffect(() => {
        if (!like) return;
        void get<Job>(`v1/jobs/${like}`).then((job) => begin(job.spec as Body));
    }, [like]);
    const choose = async (chosen: string) => {
        const { example } = await get<SceneKind>(`v1/scenes/${chosen}`);
        begin(example as unknown as Body);
    };
    const edit = (written: string) => {
        setText(written);
        try {
            const read = JSON.parse(written) as Body;
            if (typeof read !== "object" || read === null || typeof read.scene !== "object") throw new Error("a body has a scene");
            setBody(read);
            setTextError(null);
        } catch (failed) {
            setTextError(failed instanceof Error ? failed.message : String(failed));
        }
    };
    if (!body) {
        return (
            <main>
                <h1>New job</h1>
                <p>What is to be computed?</p>
                <ul class="kinds">
                    {KINDS.map(([name, says]) => <li key={name}><button type="button" onClick={() => void choose(name)}><strong>{name}</strong><span>{says}</span></button></li>)}
                </ul>
            </main>
        );
    }
    return (
        <main>
            <header class="title"><h1>New job</h1><span class="quiet">{scene?.title}</span><span class="grow" /><button type="button" onClick={() => setBody(null)}>another kind</button></header>
            <Trouble error={error} />
            <Editor body={body} scene={scene} text={text} textError={textError} onForm={begin} onText={edit} />
        </main>
    );
}

function useEstimate(body: Body, isSound: boolean): { estimate: Estimate | null; problem: Problem | null; error: Error | null } {
    const [estimate, setEstimate] = useState<Estimate | null>(null);
    const [problem, setProblem] = useState<Problem | null>(null);
    const [error, setError] = useState<Error | null>(null);
    const sent = JSON.stringify(body);
    useEffect(() => {
        if (!isSound) return;
        const abort = new AbortController();
        const timer = window.setTimeout(() => {
            request("v1/estimates", { method: "POST", body, signal: abort.signal }).then(
                async (answer) => {
                    setEstimate((await answer.json()) as Estimate);
                    setProblem(null);
                    setError(null);
                },
                (failed: unknown) => {
                    if (abort.signal.aborted) return;
                    setEstimate(null);
                    setProblem(failed instanceof Refusal ? failed.problem : null);
                    setError(failed instanceof Refusal ? null : (failed as Error));
                },
            );
        }, ESTIMATE_PAUSE_MS);
        return () => {
            abort.abort();
            window.clearTimeout(timer);
        };
    }, [sent, isSound]);
    return { estimate, problem, error };
}

interface EditorProps {
    body: Body;
    scene: SceneKind | null;
    text: string;
    textError: string | null;
    onForm: (body: Body) => void;
    onText: (text: string) => void;
}

function Editor({ body, scene, text, textError, onForm, onText }: EditorProps) {
    const { estimate, problem, error } = useEstimate(body, textError === null);
    const errors = problem?.errors ?? [];
    const placed = useRef(new Set<string>());
    placed.current = new Set();
    const errorsAt = (pointer: string) => {
        const found = errors.filter((item) => item.pointer === pointer);
        if (found.length > 0) placed.current.add(pointer);
        return found;
    };
    const submit = async () => {
        const made = await post<Job>("v1/jobs", body);
        go(`/jobs/${made.id}`);
    };
    const schema = scene?.schema as Schema | undefined;
    const set = (pointer: string[], value: unknown) => onForm(withValue(body, pointer, value) as Body);
    return (
        <div class="editor">
            <form onSubmit={(event) => event.preventDefault()} aria-label="parameters">
                {schema && <Parameter name="scene" schema={{ ...schema, properties: without(schema.properties, "kind") }} value={body.scene} pointer={["scene"]} set={set} errorsAt={errorsAt} isOpen />}
                <Parameter name="run" schema={RUN} value={body} pointer={[]} set={set} errorsAt={errorsAt} isOpen />
                <Sweep body={body} />
                <Uploads />
            </form>
            <aside>
                <EstimateBox estimate={estimate} />
                <Trouble error={error} />
                {problem && <Trouble error={new Refusal(problem)} />}
                <p class="choices"><Act kind="primary" work={submit}>start</Act> <Copy text={curl("v1/jobs", body)}>as curl</Copy></p>
                <label class="json">body
                    <textarea spellcheck={false} value={text} rows={24} onInput={(event) => onText(event.currentTarget.value)} aria-invalid={textError !== null} />
                </label>
                {textError && <p class="trouble" role="alert">{textError}</p>}
            </aside>
        </div>
    );
}

function EstimateBox({ estimate }: { estimate: Estimate | null }) {
    return (
        <section class="estimate" aria-label="estimate" aria-live="polite">
            <dl>
                <dt>particles</dt><dd>{number(estimate?.particles)}</dd>
                <dt>steps</dt><dd>{number(estimate?.steps)}</dd>
                <dt>time step</dt><dd>{number(estimate?.time_step)}</dd>
                <dt>time</dt><dd>{seconds(estimate?.wall_s)}</dd>
                <dt>CPU</dt><dd>{seconds(estimate?.cpu_s)}</dd>
                <dt>memory</dt><dd>{bytes(estimate?.memory_bytes)}</dd>
                <dt>disk</dt><dd>{bytes(estimate?.disk_bytes)}</dd>
                {Object.entries(estimate?.numbers ?? {}).map(([name, value]) => <><dt>{name}</dt><dd>{number(value)}</dd></>)}
            </dl>
            <Findings findings={estimate?.warnings ?? []} />
        </section>
    );
}

const PURPOSES = ["surface", "mesh", "points", "queries", "values", "flow", "checkpoint"];

/** Points, meshes and values from files; the id of an upload goes into the body. */
function Uploads() {
    const [purpose, setPurpose] = useState("surface");
    const [made, setMade] = useState<Upload | null>(null);
    const [error, setError] = useState<Error | null>(null);
    const send = async (file: File | undefined) => {
        if (!file) return;
        setError(null);
        try {
            const answer = await request(`v1/uploads?as=${purpose}`, { method: "POST", body: file, headers: { "Content-Type": "application/octet-stream" } });
            let upload = (await answer.json()) as Upload;
            setMade(upload);
            while (upload.state === "quarantined") {
                await new Promise((resolve) => window.setTimeout(resolve, 300));
                upload = await get<Upload>(`v1/uploads/${upload.id}`);
                setMade(upload);
            }
        } catch (failed) {
            setError(failed as Error);
        }
    };
    return (
        <details class="group">
            <summary>Files of one's own</summary>
            <label>as <select value={purpose} onChange={(event) => setPurpose(event.currentTarget.value)}>{PURPOSES.map((name) => <option key={name} value={name}>{name}</option>)}</select></label>
            <label>file <input type="file" onChange={(event) => void send(event.currentTarget.files?.[0])} /></label>
            {made && <p role="status"><code>{made.id}</code> is {made.state}{made.reason ? `: ${made.reason}` : ""}. {made.state === "ready" && <>Use it as <code>{`{"type": "${purpose === "mesh" ? "mesh" : "points"}", "upload": "${made.id}"}`}</code>.</>}</p>}
            {made?.found ? <pre>{JSON.stringify(made.found, null, 2)}</pre> : null}
            <Trouble error={error} />
        </details>
    );
}

function without(properties: Record<string, Schema> | undefined, name: string): Record<string, Schema> {
    return Object.fromEntries(Object.entries(properties ?? {}).filter(([key]) => key !== name));
}

/** A copy with a value at a place; undefined takes it away. */
function withValue(of: unknown, pointer: string[], value: unknown): unknown {
    const [key, ...rest] = pointer;
    if (key === undefined) return value;
    if (Array.isArray(of)) return of.map((item: unknown, index) => (String(index) === key ? withValue(item, rest, value) : item));
    const copy: Record<string, unknown> = { ...(of as Record<string, unknown> | undefined) };
    const inner = withValue(copy[key], rest, value);
    if (inner === undefined) delete copy[key];
    else copy[key] = inner;
    return copy;
}
