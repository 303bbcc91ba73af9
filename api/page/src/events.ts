// Events of a job or a study as they come. A hidden tab does not listen; a service that was away is tried again, and nothing is
// missed, since every stream begins behind the last event that was seen.
import { openAddress } from "./api";

export interface Event {
    id: number;
    type: string;
    at: string;
    attempt: number;
    data: Record<string, unknown>;
}

const KINDS = ["state", "progress", "checkpoint", "frame", "warning", "finding"];
const SHORTEST_PAUSE_MS = 500;
const LONGEST_PAUSE_MS = 10_000;

/** Listens until the answer is called; `onEnd` when the service has closed the stream for good. */
export function listen(path: string, after: number, onEvent: (event: Event) => void, onEnd: () => void = () => {}): () => void {
    let last = after;
    let source: EventSource | null = null;
    let pause = SHORTEST_PAUSE_MS;
    let timer: number | undefined;
    let over = false;

    const close = () => {
        source?.close();
        source = null;
        window.clearTimeout(timer);
    };
    const again = () => {
        close();
        if (over || document.hidden) return;
        timer = window.setTimeout(open, pause);
        pause = Math.min(2 * pause, LONGEST_PAUSE_MS);
    };
    const open = async () => {
        if (over || document.hidden || source) return;
        try {
            const address = await openAddress(`${path}?after=${last}`);
            if (over) return;
            source = new EventSource(address);
        } catch {
            again();
            return;
        }
        source.onopen = () => {
            pause = SHORTEST_PAUSE_MS;
        };
        source.onerror = () => {
            // A closed stream of an ended job answers 204, which a browser reports as an error like any other.
            const ended = source?.readyState === EventSource.CLOSED;
            if (ended) onEnd();
            again();
        };
        for (const kind of KINDS) {
            source.addEventListener(kind, (message) => {
                const event = JSON.parse((message as MessageEvent<string>).data) as Event;
                last = Math.max(last, event.id);
                onEvent(event);
            });
        }
    };
    const onVisibility = () => (document.hidden ? close() : void open());
    document.addEventListener("visibilitychange", onVisibility);
    void open();
    return () => {
        over = true;
        document.removeEventListener("visibilitychange", onVisibility);
        close();
    };
}
