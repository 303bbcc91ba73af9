// The frame of the page: where one is, and who one is.
import { render } from "preact";
import { useEffect, useState } from "preact/hooks";
import "uplot/dist/uPlot.min.css";
import "./page.css";
import { hasToken, onTokenWanted, signIn, signOut } from "./api";
import { Boundary } from "./parts/boundary";
import { useRoute } from "./route";
import { Compare } from "./views/compare";
import { JobPage } from "./views/job";
import { Jobs } from "./views/jobs";
import { New } from "./views/new";
import { ServicePage } from "./views/service";
import { Studies, StudyPage } from "./views/studies";

const PLACES: [string, string][] = [["jobs", "Jobs"], ["studies", "Studies"], ["new", "New"], ["service", "Service"]];

function Page() {
    const route = useRoute();
    const [place = "jobs", id] = route.path;
    const [isWanted, setWanted] = useState(false);
    const [turn, setTurn] = useState(0);
    useEffect(() => onTokenWanted(() => setWanted(true)), []);
    useEffect(() => window.scrollTo(0, 0), [route.path.join("/")]);
    return (
        <>
            <nav aria-label="views">
                <a class="brand" href="#/jobs"><img src="icon.svg" alt="" width={22} height={22} /> Meniscus</a>
                {PLACES.map(([name, label]) => <a key={name} href={`#/${name}`} aria-current={place === name ? "page" : undefined}>{label}</a>)}
                {hasToken() && <button type="button" class="link" onClick={() => { signOut(); setTurn(turn + 1); }}>sign out</button>}
            </nav>
            {isWanted && <SignIn onDone={() => { setWanted(false); setTurn(turn + 1); }} />}
            <Boundary key={`${turn} ${route.path.join("/")}`}>{view(place, id, route)}</Boundary>
        </>
    );
}

function view(place: string, id: string | undefined, route: ReturnType<typeof useRoute>) {
    switch (place) {
        case "jobs":
            return id ? <JobPage key={id} id={id} /> : <Jobs route={route} />;
        case "studies":
            return id ? <StudyPage key={id} id={id} /> : <Studies />;
        case "new":
            return <New key={route.query.get("like")} route={route} />;
        case "compare":
            return <Compare ids={(id ?? "").split(",").filter(Boolean)} />;
        case "service":
            return <ServicePage />;
        default:
            return <main><p class="empty">There is no such view.</p></main>;
    }
}

function SignIn({ onDone }: { onDone: () => void }) {
    const [given, setGiven] = useState("");
    const [keep, setKeep] = useState(false);
    return (
        <form class="sign-in" onSubmit={(event) => { event.preventDefault(); signIn(given.trim(), keep); onDone(); }}>
            <label>token <input type="password" autocomplete="off" value={given} onInput={(event) => setGiven(event.currentTarget.value)} required /></label>
            <label><input type="checkbox" checked={keep} onChange={() => setKeep(!keep)} /> keep it for this tab</label>
            <button type="submit" class="primary">sign in</button>
        </form>
    );
}

const place = document.getElementById("page");
if (place) render(<Page />, place);
