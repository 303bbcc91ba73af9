// A new job: a form made from the schema of its scene, beside the body as JSON; either can be edited, and the service says of both
// what it thinks.
import { useEffect, useState } from "preact/hooks";
import { get, post, Refusal, request, type Estimate, type Job, type Page, type Problem, type SceneKind, type Upload } from "../api";
import { bytes, curl, number, seconds } from "../format";
import { useLoaded } from "../load";
import { Act, Copy, Findings, Trouble } from "../parts/basics";
import { Parameter, type Schema } from "../parts/form";
import { Preview } from "../parts/preview";
import { Sweep } from "../parts/sweep";
import { go, type Route } from "../route";

type Body = { scene: Record<string, unknown> } & Record<string, unknown>;

const ESTIMATE_PAUSE_MS = 350;

/** The description of the API, loaded once: it is long, and does not change while the service runs. */
let described: Promise<{ components: { schemas: Record<string, Schema> } }> | null = null;

/** What a body has beside its scene, as the service declares it. */
async function loadRunSchema(): Promise<Schema> {
    described ??= get("openapi.json");
    described.catch(() => { described = null; });
    const { properties } = (await described).components.schemas.JobSpec ?? {};
    return { type: "object", properties: without(without(properties, "scene"), "restart") };
}

export function New({ route }: { route: Route }) {
    const like = route.query.get("like");
    const [body, setBody] = useState<Body | null>(null);
    const [text, setText] = useState("");
    const [textError, setTextError] = useState<string | null>(null);
    const kind = String(body?.scene.kind ?? "");
    const { data: kinds } = useLoaded((signal) => get<Page<SceneKind>>("v1/scenes", signal), []);
    const { data: run } = useLoaded(loadRunSchema, []);
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
                    {(kinds?.items ?? []).map(({ kind: name, title }) => <li key={name}><button type="button" onClick={() => void choose(name)}><strong>{name}</strong><span>{title}</span></button></li>)}
                </ul>
            </main>
        );
    }
    return (
        <main>
            <header class="title"><h1>New job</h1><span class="quiet">{scene?.title}</span><span class="grow" /><button type="button" onClick={() => setBody(null)}>another kind</button></header>
            <Trouble error={error} />
            <Editor body={body} scene={scene} run={run} text={text} textError={textError} onForm={begin} onText={edit} />
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
    /** What the body has beside its scene. */
    run: Schema | null;
    text: string;
    textError: string | null;
    onForm: (body: Body) => void;
    onText: (text: string) => void;
}

function Editor({ body, scene, run, text, textError, onForm, onText }: EditorProps) {
    const { estimate, problem, error } = useEstimate(body, textError === null);
    const errors = problem?.errors ?? [];
    const errorsAt = (pointer: string) => errors.filter((item) => item.pointer === pointer);
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
                {run && <Parameter name="run" schema={run} value={body} pointer={[]} set={set} errorsAt={errorsAt} isOpen />}
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

/** What a file is uploaded as, and how a body names it then. */
const PURPOSES: Record<string, (id: string) => string> = {
    surface: (id) => `"surface": {"type": "points", "upload": "${id}"}`,
    mesh: (id) => `"shape": {"type": "mesh", "upload": "${id}"}`,
    points: (id) => `"shape": {"type": "points", "upload": "${id}"}`,
    queries: (id) => `"queries": {"type": "points", "upload": "${id}"}`,
    values: (id) => `{"type": "data", "name": "u", "upload": "${id}"}`,
    flow: (id) => `"flow": {"type": "grid", "upload": "${id}"}`,
    checkpoint: (id) => `"restart": {"upload": "${id}"}`,
};

/** Points, meshes and values from files; the id of an upload goes into the body. */
function Uploads() {
    const [purpose, setPurpose] = useState("surface");
    const [made, setMade] = useState<Upload | null>(null);
    const [file, setFile] = useState<File | null>(null);
    const [error, setError] = useState<Error | null>(null);
    const send = async (chosen: File | undefined) => {
        if (!chosen) return;
        setError(null);
        setMade(null);
        setFile(chosen);
        try {
            const answer = await request(`v1/uploads?as=${purpose}`, { method: "POST", body: chosen, headers: { "Content-Type": "application/octet-stream" } });
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
            <label>as <select value={purpose} onChange={(event) => setPurpose(event.currentTarget.value)}>{Object.keys(PURPOSES).map((name) => <option key={name} value={name}>{name}</option>)}</select></label>
            <label>file <input type="file" onChange={(event) => void send(event.currentTarget.files?.[0])} /></label>
            {made && <p role="status"><code>{made.id}</code> is {made.state}{made.reason ? `: ${made.reason}` : ""}. {made.state === "ready" && <>A body names it so: <code>{PURPOSES[made.as]?.(made.id)}</code></>}</p>}
            {file && <Preview file={file} />}
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
    // A choice may be written as its word alone.
    const copy: Record<string, unknown> = typeof of === "string" ? { type: of } : { ...(of as Record<string, unknown> | undefined) };
    const inner = withValue(copy[key], rest, value);
    if (inner === undefined) delete copy[key];
    else copy[key] = inner;
    return copy;
}
