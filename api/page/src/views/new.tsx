// A new job: a form made from the schema of its scene, beside the body as JSON; either can be edited, and the service says of both
// what it thinks.
import { useEffect, useRef, useState } from "preact/hooks";
import { create, get, Refusal, request, type Estimate, type Job, type Page, type Problem, type SceneKind, type Upload } from "../api";
import { schemaOf } from "../description";
import { ago, bytes, curl, number, seconds } from "../format";
import { useLoaded } from "../load";
import { Act, Copy, Findings, State, Trouble } from "../parts/basics";
import { Parameter, type Schema } from "../parts/form";
import { Preview } from "../parts/preview";
import { Sweep } from "../parts/sweep";
import { go, type Route } from "../route";
import { isRecord, withValue } from "../values";

type Body = { scene?: Record<string, unknown>; restart?: unknown } & Record<string, unknown>;

/** The body that was being written when this view was left, for as long as the tab is open. */
let draft: { body: Body; text: string } | null = null;

const ESTIMATE_PAUSE_MS = 350;

/** What a body has beside its scene, as the service declares it. */
async function loadRunSchema(): Promise<Schema> {
    const { properties } = await schemaOf("JobSpec");
    return { type: "object", properties: without(without(properties, "scene"), "restart") };
}

export function New({ route }: { route: Route }) {
    const like = route.query.get("like");
    const kept = like ? null : draft;
    const [body, setBody] = useState<Body | null>(kept?.body ?? null);
    const [text, setText] = useState(kept?.text ?? "");
    const [textError, setTextError] = useState<string | null>(null);
    const [failure, setFailure] = useState<Error | null>(null);
    const kind = String(body?.scene?.kind ?? "");
    const { data: kinds, error: withoutKinds } = useLoaded((signal) => get<Page<SceneKind>>("v1/scenes", signal), []);
    const { data: run } = useLoaded(loadRunSchema, []);
    const { data: scene, error } = useLoaded<SceneKind | null>(async (signal) => (kind ? get<SceneKind>(`v1/scenes/${kind}`, signal) : null), [kind]);

    // Two fields may change before the page is drawn anew.
    const latest = useRef(body);
    const change = (pointer: string[], value: unknown) => begin(withValue(latest.current, pointer, value) as Body);
    const begin = (next: Body) => {
        latest.current = next;
        setBody(next);
        setText(JSON.stringify(next, null, 2));
        setTextError(null);
    };
    const said = (failed: unknown) => setFailure(failed instanceof Error ? failed : new Error(String(failed)));
    useEffect(() => {
        if (!like) return;
        get<Job>(`v1/jobs/${like}`).then((job) => begin(job.spec as Body), said);
    }, [like]);
    useEffect(() => {
        draft = body && !textError ? { body, text } : draft;
    }, [body, text, textError]);
    const choose = (chosen: string) => {
        setFailure(null);
        get<SceneKind>(`v1/scenes/${chosen}`).then(({ example }) => begin(example as unknown as Body), said);
    };
    const edit = (written: string) => {
        setText(written);
        try {
            const read = JSON.parse(written) as unknown;
            if (!isRecord(read) || !(isRecord(read.scene) || isRecord(read.restart))) throw new Error("a body is an object with a scene, or with a restart");
            latest.current = read as Body;
            setBody(read as Body);
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
                <Trouble error={failure ?? withoutKinds} />
                <ul class="kinds">
                    {(kinds?.items ?? []).map(({ kind: name, title }) => <li key={name}><button type="button" onClick={() => choose(name)}><strong>{name}</strong><span>{title}</span></button></li>)}
                </ul>
            </main>
        );
    }
    return (
        <main>
            <header class="title"><h1>New job</h1><span class="quiet">{scene?.title}</span><span class="grow" /><button type="button" onClick={() => { draft = null; setBody(null); }}>another kind</button></header>
            <Trouble error={error} />
            <Editor body={body} scene={scene} run={run} text={text} textError={textError} onForm={change} onText={edit} />
        </main>
    );
}

function useEstimate(body: Body, isSound: boolean): { estimate: Estimate | null; problem: Problem | null; error: Error | null } {
    const [estimate, setEstimate] = useState<Estimate | null>(null);
    const [problem, setProblem] = useState<Problem | null>(null);
    const [error, setError] = useState<Error | null>(null);
    const sent = JSON.stringify(body);
    useEffect(() => {
        if (!isSound) {
            setEstimate(null);
            setProblem(null);
            return;
        }
        const abort = new AbortController();
        const timer = window.setTimeout(() => {
            request("v1/estimates", { method: "POST", body, signal: abort.signal }).then((answer) => answer.json()).then(
                (found) => {
                    setEstimate(found as Estimate);
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
    onForm: (pointer: string[], value: unknown) => void;
    onText: (text: string) => void;
}

function Editor({ body, scene, run, text, textError, onForm, onText }: EditorProps) {
    const isSound = textError === null;
    const { estimate, problem, error } = useEstimate(body, isSound);
    const errors = problem?.errors ?? [];
    const errorsAt = (pointer: string) => errors.filter((item) => item.pointer === pointer);
    const submit = async () => {
        const made = await create<Job>("v1/jobs", body);
        draft = null;
        go(`/jobs/${made.id}`);
    };
    const schema = scene?.schema as Schema | undefined;
    return (
        <div class="editor">
            <form onSubmit={(event) => event.preventDefault()} aria-label="parameters">
                {/* Of a body that cannot be read there is nothing to change here. */}
                <fieldset class="all" disabled={!isSound}>
                {schema && body.scene && <Parameter name="scene" schema={{ ...schema, properties: without(schema.properties, "kind") }} value={body.scene} pointer={["scene"]} set={onForm} errorsAt={errorsAt} isOpen />}
                {run && <Parameter name="run" schema={run} value={body} pointer={[]} set={onForm} errorsAt={errorsAt} isOpen />}
                <Sweep body={body} />
                </fieldset>
                <Uploads />
            </form>
            <aside>
                <EstimateBox estimate={estimate} />
                <Trouble error={error} />
                {problem && <Trouble error={new Refusal(problem)} />}
                <p class="choices"><Act kind="primary" work={submit} isOff={!isSound}>start</Act> {isSound && <Copy text={curl("v1/jobs", body)}>as curl</Copy>}</p>
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
    checkpoint: (id) => `{"restart": {"upload": "${id}"}}`,
};

/** Points, meshes and values from files; the id of an upload goes into the body. */
function Uploads() {
    const [purpose, setPurpose] = useState("surface");
    const [made, setMade] = useState<Upload | null>(null);
    const [file, setFile] = useState<File | null>(null);
    const [error, setError] = useState<Error | null>(null);
    const { data: before, reload } = useLoaded((signal) => get<Page<Upload>>("v1/uploads", signal), []);
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
            reload();
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
            {before && before.items.length > 0 && (
                <table aria-label="uploads">
                    <thead><tr><th scope="col">upload</th><th scope="col">as</th><th scope="col">state</th><th scope="col">made</th></tr></thead>
                    <tbody>{before.items.map((one) => <tr key={one.id}><td><code>{one.id}</code></td><td>{one.as}</td><td><State state={one.state} reason={one.reason} /></td><td>{ago(one.created_at)}</td></tr>)}</tbody>
                </table>
            )}
            {made?.found ? <pre>{JSON.stringify(made.found, null, 2)}</pre> : null}
            <Trouble error={error} />
        </details>
    );
}

function without(properties: Record<string, Schema> | undefined, name: string): Record<string, Schema> {
    return Object.fromEntries(Object.entries(properties ?? {}).filter(([key]) => key !== name));
}
