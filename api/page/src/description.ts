// The description of the API, loaded once: it is long, and does not change while the service runs.
import { get } from "./api";
import type { Schema } from "./parts/form";

let described: Promise<{ components: { schemas: Record<string, Schema> } }> | null = null;

/** A schema that the service declares. */
export async function schemaOf(name: string): Promise<Schema> {
    described ??= get("openapi.json");
    described.catch(() => { described = null; });
    return (await described).components.schemas[name] ?? {};
}
