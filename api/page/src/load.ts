// Data of a view: loaded, loaded again while it matters, and kept on the screen while the service is away.
import { useCallback, useEffect, useRef, useState } from "preact/hooks";

export interface Loaded<T> {
    data: T | null;
    error: Error | null;
    reload: () => void;
}

/** Loads at once, again when a key changes, and every so many milliseconds while the page is seen; 0 for never. */
export function useLoaded<T>(load: (signal: AbortSignal) => Promise<T>, keys: unknown[], everyMs = 0): Loaded<T> {
    const [data, setData] = useState<T | null>(null);
    const [error, setError] = useState<Error | null>(null);
    const [turn, setTurn] = useState(0);
    const latest = useRef(load);
    latest.current = load;
    const reload = useCallback(() => setTurn((count) => count + 1), []);
    useEffect(() => setData(null), keys);
    useEffect(() => {
        const abort = new AbortController();
        latest.current(abort.signal).then(
            (found) => {
                if (abort.signal.aborted) return;
                setData(found);
                setError(null);
            },
            (failed: unknown) => {
                if (!abort.signal.aborted) setError(failed instanceof Error ? failed : new Error(String(failed)));
            },
        );
        return () => abort.abort();
    }, [...keys, turn]);
    useEffect(() => {
        if (everyMs <= 0) return;
        const timer = window.setInterval(() => document.hidden || reload(), everyMs);
        const onVisibility = () => document.hidden || reload();
        document.addEventListener("visibilitychange", onVisibility);
        return () => {
            window.clearInterval(timer);
            document.removeEventListener("visibilitychange", onVisibility);
        };
    }, [...keys, everyMs]);
    return { data, error, reload };
}
