// The address of a view: `#/jobs?state=running`. A filtered list is a link.
import { useEffect, useState } from "preact/hooks";

export interface Route {
    path: string[];
    query: URLSearchParams;
}

/** A part of an address; what is no valid part stays as it is. */
function decoded(part: string): string {
    try {
        return decodeURIComponent(part);
    } catch {
        return part;
    }
}

function read(): Route {
    const [path = "", query = ""] = location.hash.replace(/^#\/?/, "").split("?");
    return { path: path.split("/").filter(Boolean).map(decoded), query: new URLSearchParams(query) };
}

export function useRoute(): Route {
    const [route, setRoute] = useState(read);
    useEffect(() => {
        const onChange = () => setRoute(read());
        addEventListener("hashchange", onChange);
        return () => removeEventListener("hashchange", onChange);
    }, []);
    return route;
}

export function go(address: string): void {
    location.hash = address;
}

/** Changes parts of the query in place. */
export function setQuery(route: Route, changes: Record<string, string | null>): void {
    const query = new URLSearchParams(route.query);
    for (const [name, value] of Object.entries(changes)) {
        if (value === null || value === "") query.delete(name);
        else query.set(name, value);
    }
    const text = query.toString();
    history.replaceState(null, "", `#/${route.path.join("/")}${text ? `?${text}` : ""}`);
    dispatchEvent(new HashChangeEvent("hashchange"));
}
