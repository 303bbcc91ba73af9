// The service itself: whether it is well, what it gives, and where its interface is described.
import { get, request, type Page, type SceneKind, type Service } from "../api";
import { bytes, number, seconds } from "../format";
import { useLoaded } from "../load";
import { Trouble } from "../parts/basics";

const REFRESH_MS = 5000;

/** Values of a Prometheus text by their names with labels. */
function readMetrics(text: string): Map<string, number> {
    const values = new Map<string, number>();
    for (const line of text.split("\n")) {
        const found = /^([a-z_]+(?:\{[^}]*\})?) (\S+)$/.exec(line);
        if (found?.[1] && found[2]) values.set(found[1], Number(found[2]));
    }
    return values;
}

export function ServicePage() {
    const { data: service, error } = useLoaded((signal) => get<Service>("v1", signal), []);
    const { data: ready } = useLoaded(async (signal) => {
        try {
            await request("readyz", { signal });
            return "ready";
        } catch {
            return "not ready";
        }
    }, [], REFRESH_MS);
    const { data: metrics } = useLoaded(async (signal) => readMetrics(await (await request("metrics", { accept: "text/plain", signal })).text()), [], REFRESH_MS);
    const { data: kinds } = useLoaded((signal) => get<Page<SceneKind>>("v1/scenes", signal), []);
    const metric = (name: string) => metrics?.get(name);
    const jobs = [...(metrics ?? new Map<string, number>())].filter(([name, value]) => name.startsWith("meniscus_jobs{") && value > 0);
    const cluster = [...(metrics ?? new Map<string, number>())].filter(([name]) => name.startsWith("meniscus_slurm_jobs{"));
    const nodes = [...(metrics ?? new Map<string, number>())].flatMap(([name, value]) => {
        const node = /^meniscus_slurm_node_jobs\{node="([^"]+)"/.exec(name)?.[1];
        return node ? [{ node, jobs: value, isExcluded: metric(`meniscus_slurm_node_excluded{node="${node}"}`) === 1 }] : [];
    });
    return (
        <main>
            <header class="title"><h1>Service</h1><span role="status">{ready ?? "–"}</span></header>
            <Trouble error={error} />
            <dl>
                <dt>version</dt><dd>{service?.build}</dd>
                <dt>instruction set</dt><dd>{service?.isa}</dd>
                <dt>slots</dt><dd>{number(metric("meniscus_slots") ?? service?.limits.slots)}</dd>
                <dt>threads of a job</dt><dd>{number(service?.limits.threads)}</dd>
                <dt>memory of a job</dt><dd>{bytes(service?.limits.memory_bytes)}</dd>
                <dt>largest upload</dt><dd>{bytes(service?.limits.upload_bytes)}</dd>
                <dt>free disk</dt><dd>{bytes(metric("meniscus_disk_free_bytes"))}</dd>
                <dt>free memory</dt><dd>{bytes(metric("meniscus_memory_available_bytes"))}</dd>
                <dt>memory of the service</dt><dd>{bytes(metric("meniscus_resident_bytes"))}</dd>
                <dt>oldest job in the queue</dt><dd>{seconds(metric("meniscus_queue_oldest_seconds"))}</dd>
                {jobs.map(([name, value]) => <><dt>{/state="([^"]+)"/.exec(name)?.[1]}</dt><dd>{number(value)}</dd></>)}
                {cluster.map(([name, value]) => <><dt>{/state="([^"]+)"/.exec(name)?.[1]} in the cluster</dt><dd>{number(value)}</dd></>)}
                {metric("meniscus_slurm_table_age_seconds") !== undefined && <><dt>last answer of the cluster</dt><dd>{seconds(metric("meniscus_slurm_table_age_seconds"))} ago</dd></>}
            </dl>
            {nodes.length > 0 && (
                <table>
                    <caption>Nodes of the cluster that have had jobs</caption>
                    <thead><tr><th scope="col">node</th><th scope="col">jobs</th><th scope="col">left out</th></tr></thead>
                    <tbody>{nodes.map(({ node, jobs: count, isExcluded }) => <tr key={node}><td>{node}</td><td class="figure">{number(count)}</td><td>{isExcluded ? "yes, it lost attempts" : "no"}</td></tr>)}</tbody>
                </table>
            )}
            <p><a href="openapi.json">Description of the API (OpenAPI)</a> · <a href="metrics">metrics</a></p>
            <h2>Scenes and their parameters</h2>
            {(kinds?.items ?? []).map((kind) => (
                <details key={kind.kind} class="group">
                    <summary><strong>{kind.kind}</strong> {kind.title}</summary>
                    <table>
                        <thead><tr><th scope="col">parameter</th><th scope="col">meaning</th><th scope="col">default</th></tr></thead>
                        <tbody>
                            {Object.entries((kind.schema as { properties?: Record<string, { description?: string; default?: unknown }> }).properties ?? {}).map(([name, schema]) => (
                                <tr key={name}><th scope="row"><code>{name}</code></th><td>{schema.description}</td><td><code>{schema.default === undefined ? "" : JSON.stringify(schema.default)}</code></td></tr>
                            ))}
                        </tbody>
                    </table>
                </details>
            ))}
        </main>
    );
}
