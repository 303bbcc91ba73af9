// Calls of the public API. Addresses are relative to the page, so that it works below any base path.
import type { components } from "./api-types";

type Schemas = components["schemas"];
export type Job = Schemas["JobView"];
export type Problem = Schemas["Problem"];
export type Finding = Schemas["FindingView"];
export type Study = Schemas["StudyView"];
export type Estimate = Schemas["EstimateView"];
export type FileEntry = Schemas["FileView"];
export type Checkpoint = Schemas["CheckpointView"];
export type SceneKind = Schemas["SceneKindView"];
export type Service = Schemas["ServiceView"];
export type Report = Schemas["ReportView"];
export type Upload = Schemas["UploadView"];

/** A list of the API: a page of items, and where the next page begins. */
export interface Page<T> {
    items: T[];
    next?: string | number | null;
}

/** What the service says when it refuses. */
export class Refusal extends Error {
    constructor(readonly problem: Problem) {
        super(problem.detail ?? problem.title);
    }
}

/** The service cannot be reached. */
export class Unreachable extends Error {}

const STORED_TOKEN = "meniscus-token";
let token = sessionStorage.getItem(STORED_TOKEN);
/** Keys of creations that have had no answer yet. */
const keys = new Map<string, string>();
const tokenWanted = new Set<() => void>();

/** Signs in. The token stays in memory, and by choice in the storage of this tab. */
export function signIn(given: string, keep: boolean): void {
    token = given;
    if (keep) sessionStorage.setItem(STORED_TOKEN, given);
}

export function signOut(): void {
    token = null;
    sessionStorage.removeItem(STORED_TOKEN);
}

export const hasToken = (): boolean => token !== null;

/** Calls back when the service asks for a token. */
export function onTokenWanted(call: () => void): () => void {
    tokenWanted.add(call);
    return () => tokenWanted.delete(call);
}

export interface Options {
    method?: string;
    body?: unknown;
    accept?: string;
    headers?: Record<string, string>;
    signal?: AbortSignal;
}

/** One request; an answer that is no success becomes a Refusal with the service's own words. */
export async function request(path: string, options: Options = {}): Promise<Response> {
    const headers: Record<string, string> = { Accept: options.accept ?? "application/json", ...options.headers };
    if (token) headers.Authorization = `Bearer ${token}`;
    const body = options.body;
    const isRaw = body instanceof Blob;
    if (body !== undefined && !isRaw) headers["Content-Type"] = "application/json";
    let answer: Response;
    try {
        answer = await fetch(path, {
            method: options.method ?? "GET",
            headers,
            body: body === undefined ? undefined : isRaw ? body : JSON.stringify(body),
            signal: options.signal,
        });
    } catch (error) {
        if (options.signal?.aborted) throw error;
        throw new Unreachable("the service cannot be reached");
    }
    if (answer.ok) return answer;
    if (answer.status === 401) tokenWanted.forEach((call) => call());
    const text = await answer.text();
    let problem: Problem;
    try {
        problem = JSON.parse(text) as Problem;
    } catch {
        problem = { type: "about:blank", title: text || answer.statusText, status: answer.status };
    }
    throw new Refusal(problem);
}

export async function get<T>(path: string, signal?: AbortSignal): Promise<T> {
    return (await (await request(path, { signal })).json()) as T;
}

export async function post<T>(path: string, body?: unknown): Promise<T> {
    const answer = await request(path, { method: "POST", body });
    return (answer.status === 204 ? undefined : await answer.json()) as T;
}

/** Makes something, once: a request whose answer was lost and that is sent again makes no second one. */
export async function create<T>(path: string, body: unknown): Promise<T> {
    const text = JSON.stringify(body);
    const attempt = `${path} ${text}`;
    const key = keys.get(attempt) ?? crypto.getRandomValues(new Uint32Array(4)).join("-");
    keys.set(attempt, key);
    const answer = await request(path, { method: "POST", body, headers: { "Idempotency-Key": key } });
    keys.delete(attempt);
    return (await answer.json()) as T;
}

export async function remove(path: string): Promise<void> {
    await request(path, { method: "DELETE" });
}

/** An address that a browser can open by itself: with tokens on it has a ticket, never the token. */
export async function openAddress(path: string): Promise<string> {
    if (!token) return path;
    const { ticket } = await post<{ ticket: string }>("v1/tickets");
    return `${path}${path.includes("?") ? "&" : "?"}ticket=${encodeURIComponent(ticket)}`;
}
