// Steps of the tests in tests/browser/main.rs: node steps.mjs NAME URL [TOKEN]
import { createRequire } from "node:module";
import { createInterface } from "node:readline";

const require = createRequire(`${process.env.MENISCUS_NODE_TOOLS}/../x.js`);
const { chromium } = require("playwright-core");
const axe = require("axe-core");

const [name, url, token] = process.argv.slice(2);
const lines = createInterface({ input: process.stdin })[Symbol.asyncIterator]();
const WAIT = { timeout: 60_000 };

/** Says where the browser is, and waits until the test lets it go on. */
async function at(place) {
    process.stdout.write(`${place}\n`);
    await lines.next();
}

function check(is, what) {
    if (!is) throw new Error(what);
}

async function until(what, look, timeout = 60_000) {
    const end = Date.now() + timeout;
    while (Date.now() < end) {
        const found = await look();
        if (found) return found;
        await new Promise((resolve) => setTimeout(resolve, 50));
    }
    throw new Error(`it never came true that ${what}`);
}

const browser = await chromium.launch({
    executablePath: process.env.MENISCUS_CHROMIUM,
    args: ["--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-background-networking", "--disable-quic",
        "--disable-component-update", "--disable-sync", "--no-first-run"],
});
const context = await browser.newContext({ viewport: { width: 1280, height: 900 } });
const page = await context.newPage();
const home = new URL(url).origin;
const wrong = [];
/** What the browser reports on purpose in a test: the status of a refused request, a service that is away. */
let expected = /$^/;
page.on("console", (message) => {
    const text = message.text();
    if (message.type() === "error" && !expected.test(text)) wrong.push(`console: ${text}`);
});
page.on("pageerror", (error) => wrong.push(`error: ${error.message}`));
page.on("request", (request) => {
    const address = request.url();
    if (!/^(data|blob):/.test(address) && new URL(address).origin !== home) wrong.push(`a request left the host: ${address}`);
    if (token && address.includes(token)) wrong.push(`the token is in an address: ${address}`);
});

async function api(path, body, headers = {}) {
    const answer = await fetch(`${url}${path}`, body ? { method: "POST", body: JSON.stringify(body), headers: { "content-type": "application/json", ...headers } } : { headers });
    check(answer.ok, `${path}: ${answer.status} ${await answer.clone().text()}`);
    return answer.json();
}

async function ended(id) {
    return until(`${id} has ended`, async () => {
        const job = await api(`/v1/jobs/${id}`);
        return job.finished_at ? job : null;
    });
}

const vortex = (spacing = 0.05, end = 1) => ({ name: "a vortex", scene: { kind: "vortex", spacing, end_time: end, flow: { type: "single_vortex", period: 2 } }, output: { every_time: end / 5 } });

/** The share of pixels of the canvas that are not its background, and a digest of them. */
async function picture() {
    await page.locator("canvas[data-ready=yes]").first().waitFor(WAIT);
    await page.waitForTimeout(300);
    return page.locator(".canvas canvas").first().evaluate((canvas) => {
        const copy = document.createElement("canvas");
        copy.width = canvas.width;
        copy.height = canvas.height;
        const paint = copy.getContext("2d");
        paint.drawImage(canvas, 0, 0);
        const { data } = paint.getImageData(0, 0, copy.width, copy.height);
        let painted = 0;
        let digest = 0;
        for (let k = 0; k < data.length; k += 4) {
            if (data[k + 3] > 0) painted += 1;
            digest = (digest * 31 + data[k] + 3 * data[k + 1] + 7 * data[k + 2]) % 4294967291;
        }
        return { share: painted / (data.length / 4), digest };
    });
}

const steps = {
    async watch() {
        await page.goto(`${url}/`);
        await page.getByRole("link", { name: "New job" }).click();
        await page.getByRole("button", { name: /^vortex/ }).click();
        await page.getByLabel("spacing", { exact: true }).first().fill("0.04");
        await page.getByLabel("spacing", { exact: true }).first().blur();
        await until("the estimate counts particles", async () => !(await page.getByLabel("estimate").innerText()).includes("particles\n–"));
        await page.getByRole("button", { name: "start" }).click();
        await page.getByText("succeeded").first().waitFor(WAIT);
        const last = await picture();
        check(last.share > 0.05, `the canvas is empty: ${last.share}`);
        await page.getByLabel("frame", { exact: true }).fill("0");
        await until("another frame is shown", async () => (await page.locator("canvas").first().getAttribute("data-frame")) === "frames/000000.vtkhdf");
        const first = await picture();
        await page.getByRole("combobox", { name: "color by" }).selectOption("curvature");
        check((await picture()).digest !== first.digest, "another field has the same picture");
        check(first.digest !== last.digest, "the picture is the same in the first and the last frame");
        check((await page.locator(".plot canvas").count()) > 0, "the series has no plot");
        const box = await page.locator(".canvas canvas").first().boundingBox();
        await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
        check((await page.getByLabel("picked point").innerText()).includes("position"), "no point was picked");
        check((await page.locator("body").innerText()).includes("area_drift"), "the checks are shown");
    },

    async restart() {
        const { id } = await api("/v1/jobs", vortex());
        await ended(id);
        await page.goto(`${url}/#/jobs/${id}`);
        await page.getByRole("button", { name: "restart" }).first().click();
        await page.getByLabel("/end_time").fill("2");
        await page.getByRole("button", { name: "start", exact: true }).click();
        await page.waitForURL((address) => !address.href.endsWith(id), WAIT);
        const made = page.url().split("/").at(-1);
        const job = await ended(made);
        check(job.state === "succeeded" && job.progress.time === 2 && job.lineage.restarted_from, JSON.stringify(job));
        await page.getByText("2 of 2").waitFor(WAIT);
    },

    async refusal() {
        expected = /422/;
        await page.goto(`${url}/#/new`);
        await page.getByRole("button", { name: /^droplet/ }).click();
        const field = page.getByLabel("spacing", { exact: true }).first();
        await field.fill("-1");
        await field.blur();
        await page.locator(".field", { has: field }).getByRole("alert").waitFor(WAIT);
        check((await field.getAttribute("aria-invalid")) === "true", "the field is not marked");
        // By the other pane: a name with a slip.
        await page.getByLabel("body").fill('{"scene": {"kind": "droplet", "spaceing": 0.1}}');
        await page.getByText("Did you mean").first().waitFor(WAIT);
        await page.getByLabel("body").fill('{"scene": {"kind": "droplet", "spacing": 0.1, "end_time": 0.02}}');
        await until("the form follows", async () => (await page.getByLabel("spacing", { exact: true }).first().inputValue()) === "0.1");
        await until("all is well", async () => (await page.getByRole("alert").count()) === 0);
    },

    async lists() {
        await page.goto(`${url}/#/new`);
        await page.getByRole("button", { name: /^droplet/ }).click();
        const scene = {
            kind: "droplet", case: "custom", spacing: 0.05, end_time: 0.02, shape: { type: "circle", center: [0.5, 1.1], radius: 0.2 },
            domain: { low: [0, 0], high: [1, 1.5], axes: ["periodic", { low: {}, high: { velocity: [1, 0] } }] },
        };
        const body = page.getByRole("textbox", { name: "body", exact: true });
        const sent = async () => JSON.parse(await body.inputValue()).scene;
        await body.fill(JSON.stringify({ scene }));
        // A choice may be written as its word, or without it.
        await until("the first axis is periodic", async () => (await page.getByLabel("axes 1", { exact: true }).inputValue()) === "periodic");
        check((await page.getByLabel("axes 2", { exact: true }).inputValue()) === "walls", "walls are not told from their fields");
        check((await page.locator("#fieldscene-domain-axes-1-high-velocity").inputValue()) === "[1,0]", "the wall's velocity is not shown");
        await page.getByLabel("axes 1", { exact: true }).selectOption("walls");
        check((await sent()).domain.axes[0].type === "walls", "the first axis has no walls");
        expected = /422/;
        await page.locator("form fieldset.all > fieldset > button", { hasText: "more" }).first().click();
        await page.getByLabel("add to obstacles").click();
        await until("the service asks for a shape", async () => (await page.getByRole("alert").allInnerTexts()).some((said) => said.includes("shape")));
        // A body made of two: the parts of a shape are shapes.
        const shape = "fieldscene-obstacles-0-shape";
        await page.locator(`#${shape}`).selectOption("intersection");
        for (const [k, center] of ["[0.45, 0.4]", "[0.55, 0.4]"].entries()) {
            await page.getByLabel("add to of").click();
            await page.locator(`#${shape}-of-${k}`).selectOption("circle");
            await page.locator(`#${shape}-of-${k}-center`).fill(center);
            await page.locator(`#${shape}-of-${k}-radius`).fill("0.3");
            await page.locator(`#${shape}-of-${k}-radius`).blur();
        }
        await until("all is well", async () => (await page.getByRole("alert").count()) === 0);
        const { obstacles } = await sent();
        check(obstacles.length === 1 && obstacles[0].shape.of[1].center[0] === 0.55, JSON.stringify(obstacles));
        await page.getByRole("button", { name: "start", exact: true }).click();
        await page.waitForURL(/jobs\//, WAIT);
        const job = await ended(page.url().split("/").at(-1));
        check(job.state === "succeeded", JSON.stringify(job));
        await page.goto(`${url}/#/new?like=${job.id}`);
        await page.getByLabel("take out obstacles 1").click();
        check(!("obstacles" in (await sent())), "the obstacle is still there");
    },

    /** What a hand does on the way: nothing is lost, and nothing else is done than what is seen. */
    async slips() {
        expected = /40[04]|422/;
        await page.goto(`${url}/#/new`);
        await page.getByRole("button", { name: /^redistance/ }).click();
        const body = page.getByRole("textbox", { name: "body", exact: true });
        const start = page.getByRole("button", { name: "start", exact: true });
        await body.fill('{"name": "good", "scene": {"kind": "redistance", "spacing": 0.1}}');
        await until("the form follows", async () => (await page.getByLabel("spacing", { exact: true }).first().inputValue()) === "0.1");
        // A body that cannot be read starts nothing, and the form does not write over it.
        await body.fill('{"name": "bad", "scene": {"kind": ');
        check(await start.isDisabled(), "a body that cannot be read can be started");
        check(await page.getByLabel("spacing", { exact: true }).first().isDisabled(), "the form writes over a body that cannot be read");
        for (const odd of ['{"scene": null}', "[]", "3", '{"scene": {"kind": "redistance"}, "output": 7}', '{"scene": {"kind": "redistance", "shape": [1]}}', '{"restart": {"upload": "upl_1"}}']) {
            await body.fill(odd);
            check((await body.inputValue()) === odd, `the page does not live with ${odd}`);
            check(await page.getByRole("link", { name: "Jobs", exact: true }).isVisible(), `the page is gone after ${odd}`);
        }
        await body.fill('{"name": "kept", "scene": {"kind": "redistance", "spacing": 0.1}}');
        // Numbers as people write them.
        const field = page.getByLabel("spacing", { exact: true }).first();
        await field.fill(".2");
        await field.blur();
        await until("the body follows", async () => JSON.parse(await body.inputValue()).scene.spacing === 0.2);
        // What is being typed stays, while the estimate of what was typed before comes.
        await field.press("End");
        await field.pressSequentially("5");
        await page.waitForTimeout(1500);
        check((await field.inputValue()) === "0.25", `what was being typed is ${await field.inputValue()}`);
        await field.blur();
        await page.getByRole("link", { name: "Service" }).click();
        await page.getByRole("link", { name: "New", exact: true }).click();
        check(JSON.parse(await body.inputValue()).name === "kept", "a body that was being written is lost");
        // A confirmation is of what it was asked for.
        const ids = [];
        for (const kind of ["redistance", "vortex"]) ids.push((await api("/v1/jobs", { name: kind, labels: { figure: kind }, scene: { kind, spacing: 0.1, ...(kind === "vortex" ? { end_time: 0.1 } : {}) } })).id);
        for (const id of ids) await ended(id);
        await page.goto(`${url}/#/jobs?kind=redistance`);
        await page.getByRole("button", { name: "delete", exact: true }).click();
        await page.getByRole("alertdialog").waitFor(WAIT);
        await page.getByLabel("kind").selectOption("vortex");
        check((await page.getByRole("alertdialog").count()) === 0, "a confirmation outlives its filter");
        await page.goto(`${url}/#/jobs?label.figure=vortex`);
        await until("the list is filtered", async () => (await page.locator("table.jobs tbody tr").count()) === 1);
        check((await page.getByText("label.figure: vortex").count()) === 1, "the filter is not shown");
        await page.getByRole("button", { name: "pause", exact: true }).click();
        await page.getByText("0 of 1 jobs let you pause them").waitFor(WAIT);
        // Addresses of nothing.
        for (const place of ["jobs/%", "jobs/job_nothing", "studies/study_nothing", "new?like=job_nothing", `compare/${ids[0]},job_nothing`, "nowhere"]) {
            await page.goto(`${url}/#/${place}`);
            await page.getByRole("link", { name: "Jobs", exact: true }).waitFor(WAIT);
            await until(`${place} says something`, async () => (await page.locator("main").innerText()).trim().length > 12);
        }
        await page.goto(`${url}/#/compare/${ids[0]},job_nothing`);
        await page.getByRole("heading", { name: "redistance" }).waitFor(WAIT);
    },

    async refine() {
        await page.goto(`${url}/#/new`);
        await page.getByRole("button", { name: /^redistance/ }).click();
        await page.getByRole("textbox", { name: "body", exact: true }).fill('{"name": "to a tolerance", "scene": {"kind": "redistance"}}');
        await page.getByText("As a study").click();
        await page.getByLabel("mode").last().selectOption("refine");
        const at = (name) => page.locator(`#fieldsweep-${name}`);
        await at("from").fill("0.08");
        await at("quantity-error-quantity").fill("phi");
        await at("quantity-error-norm").fill("rms");
        await at("until-tolerance").fill("1e-4");
        await at("until-tolerance").blur();
        await page.getByRole("button", { name: "count" }).click();
        await page.getByText(/of CPU time,/).waitFor(WAIT);
        await page.getByRole("button", { name: "start the study" }).click();
        await page.waitForURL(/studies\//, WAIT);
        await page.getByText("succeeded").first().waitFor(WAIT);
        await until("the tolerance is met", async () => /tolerance\s+met/.test(await page.locator("main").innerText()));
        await until("the levels are shown", async () => (await page.getByRole("table", { name: "levels" }).locator("tbody tr").count()) >= 3);
        check((await page.locator(".plot canvas").count()) > 0, "the errors have no plot");
    },

    async study() {
        await page.goto(`${url}/#/new`);
        await page.getByRole("button", { name: /^redistance/ }).click();
        await page.getByLabel("body").fill('{"name": "orders", "scene": {"kind": "redistance"}}');
        await page.getByText("As a study").click();
        await page.getByLabel("values 1").fill("0.05, 0.035, 0.025");
        await page.getByRole("button", { name: "count" }).click();
        await page.getByText(/^3 points/).waitFor(WAIT);
        await page.getByRole("button", { name: "start the study" }).click();
        await page.getByRole("heading", { name: "orders" }).waitFor(WAIT);
        const id = page.url().split("/").at(-1);
        await until("the study has ended", async () => (await api(`/v1/studies/${id}`)).state === "succeeded");
        await until("all points are in the table", async () => (await page.locator(".scroll tbody tr").count()) === 3);
        await page.locator(".plot canvas").first().waitFor(WAIT);
        await page.getByText(/order \d/).first().waitFor(WAIT);
        // A drop with a step that is far too long.
        const failing = { name: "too fast", scene: { kind: "droplet", spacing: 0.1, end_time: 1, time_step: 0.05, allow_soft: true } };
        const job = await ended((await api("/v1/jobs", failing)).id);
        check(job.state === "failed", JSON.stringify(job));
        await page.goto(`${url}/#/jobs/${job.id}`);
        await page.getByText(job.reason).first().waitFor(WAIT);
        await page.getByText(job.hint).first().waitFor(WAIT);
    },

    async jobs() {
        const made = [];
        for (const spacing of [0.06, 0.05]) made.push((await api("/v1/jobs", { ...vortex(spacing), name: `h = ${spacing}` })).id);
        await Promise.all(made.map(ended));
        await page.goto(`${url}/#/jobs?kind=vortex`);
        await until("both are there", async () => (await page.locator(".jobs tbody tr").count()) === 2);
        await page.getByRole("combobox", { name: "state" }).selectOption("failed");
        await page.getByText("No job is like that.").waitFor(WAIT);
        check(page.url().includes("state=failed"), "the filter is not in the address");
        await page.getByRole("combobox", { name: "state" }).selectOption("");
        await until("both are there again", async () => (await page.locator(".jobs tbody tr").count()) === 2);
        for (const box of await page.getByRole("checkbox").all()) await box.check();
        await page.getByRole("link", { name: "Compare 2" }).click();
        await until("two pictures", async () => (await page.locator("canvas[data-ready=yes]").count()) === 2);
        await page.locator(".plot canvas").first().waitFor(WAIT);
        await page.goto(`${url}/#/jobs?kind=vortex`);
        await page.getByRole("button", { name: "delete" }).click();
        await page.getByRole("button", { name: "yes, delete" }).click();
        await until("they are gone", async () => (await api("/v1/jobs")).items.length === 0);
    },

    async upload() {
        await page.goto(`${url}/#/new`);
        await page.getByRole("button", { name: /^surface_pde/ }).click();
        await page.getByText("Files of one's own").click();
        // An octahedron as OBJ, then the same corners as points.
        const corners = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
        const faces = [[1, 3, 5], [3, 2, 5], [2, 4, 5], [4, 1, 5], [3, 1, 6], [2, 3, 6], [4, 2, 6], [1, 4, 6]];
        const obj = [...corners.map((at) => `v ${at.join(" ")}`), ...faces.map((at) => `f ${at.join(" ")}`)].join("\n");
        await page.getByRole("combobox", { name: "as" }).selectOption("mesh");
        await page.getByLabel("file").setInputFiles({ name: "octahedron.obj", mimeType: "text/plain", buffer: Buffer.from(obj) });
        await page.getByText("octahedron.obj: 6 points, 8 triangles").waitFor(WAIT);
        await page.getByText("is ready").waitFor(WAIT);
        await page.waitForTimeout(500);
        const share = async () => page.getByLabel(/^preview/).evaluate((canvas) => {
            const copy = document.createElement("canvas");
            [copy.width, copy.height] = [canvas.width, canvas.height];
            const paint = copy.getContext("2d");
            paint.drawImage(canvas, 0, 0);
            const { data } = paint.getImageData(0, 0, copy.width, copy.height);
            return data.filter((value, k) => k % 4 === 3 && value > 0).length / (data.length / 4);
        });
        check((await share()) > 0.01, `the preview of the mesh is empty: ${await share()}`);
        await page.getByRole("combobox", { name: "as" }).selectOption("points");
        await page.getByLabel("file").setInputFiles({ name: "six.xyz", mimeType: "text/plain", buffer: Buffer.from(corners.map((at) => at.join(" ")).join("\n")) });
        await page.getByText("six.xyz: 6 points").waitFor(WAIT);
    },

    async recovery() {
        expected = /ERR_|Failed to load resource|net::/;
        const { id } = await api("/v1/jobs", { ...vortex(0.02, 4), name: "it goes on" });
        await page.goto(`${url}/#/jobs/${id}`);
        await page.getByText("running").first().waitFor(WAIT);
        await page.evaluate(() => { window.stayed = true; });
        await at("running");
        await page.getByText("cannot be reached").waitFor(WAIT);
        await at("away");
        await page.getByText("succeeded").first().waitFor({ timeout: 120_000 });
        check(await page.evaluate(() => window.stayed === true), "the page was loaded again");
    },

    async tokens() {
        expected = /401/;
        const below = `${url}/lab`;
        await page.goto(`${below}/`);
        await page.getByLabel("token", { exact: true }).fill(token);
        await page.getByRole("button", { name: "sign in" }).click();
        await page.getByText("There is no job yet").waitFor(WAIT);
        const answer = await fetch(`${below}/v1/jobs`, { method: "POST", body: JSON.stringify(vortex()), headers: { "content-type": "application/json", authorization: `Bearer ${token}` } });
        const { id } = await answer.json();
        await page.goto(`${below}/#/jobs/${id}`);
        await page.getByText("succeeded").first().waitFor(WAIT);
        check((await picture()).share > 0.05, "the canvas is empty");
    },

    async access() {
        const { id } = await api("/v1/jobs", vortex());
        await ended(id);
        const sweep = { mode: "grid", axes: { "/scene/spacing": [0.1, 0.08] } };
        const study = await api("/v1/studies", { base: { scene: { kind: "redistance" } }, sweep });
        await until("the study has ended", async () => (await api(`/v1/studies/${study.id}`)).state === "succeeded");
        for (const colorScheme of ["light", "dark"]) {
            await page.emulateMedia({ colorScheme });
            for (const place of ["jobs", `jobs/${id}`, "studies", `studies/${study.id}`, "new", `new?like=${id}`, "service", `compare/${id},${id}`]) {
                await page.goto(`${url}/#/${place}`);
                await page.reload();
                await page.locator("h1").waitFor(WAIT);
                await page.waitForTimeout(400);
                await page.evaluate(axe.source);
                const found = await page.evaluate(() => window.axe.run(document, { resultTypes: ["violations"] }));
                const serious = found.violations.filter(({ impact }) => impact === "serious" || impact === "critical");
                check(serious.length === 0, `${place}, ${colorScheme}: ${serious.map((one) => `${one.id} ${one.nodes.map((node) => node.html).join(" ").slice(0, 400)}`).join("; ")}`);
            }
        }
        await page.setViewportSize({ width: 360, height: 740 });
        for (const place of ["jobs", `jobs/${id}`, `studies/${study.id}`, "new", "service"]) {
            await page.goto(`${url}/#/${place}`);
            await page.reload();
            await page.waitForTimeout(400);
            const width = await page.evaluate(() => document.documentElement.scrollWidth);
            check(width <= 360, `${place} is ${width} px wide`);
        }
        await page.setViewportSize({ width: 1280, height: 900 });
        await page.goto(`${url}/#/jobs`);
        await page.getByRole("link", { name: "a vortex" }).focus();
        await page.keyboard.press("Enter");
        await page.getByRole("heading", { name: "a vortex" }).waitFor(WAIT);
    },
};

/** Pictures for docs/guide. */
steps.pictures = async () => {
    const folder = process.env.MENISCUS_PICTURES;
    check(folder, "MENISCUS_PICTURES says where the pictures go");
    const bodies = [
        { name: "single vortex", scene: { kind: "vortex", spacing: 0.02, flow: { type: "single_vortex", period: 4 }, end_time: 4 }, output: { every_time: 0.5 } },
        { name: "oscillating drop", scene: { kind: "droplet", spacing: 0.05, end_time: 0.4 }, output: { every_time: 0.05 } },
        { name: "growing sphere", scene: { kind: "front", dimension: 3, spacing: 0.08, shape: { type: "sphere", center: [0, 0, 0], radius: 0.5 } }, output: { every_time: 0.05 } },
        { name: "too fast", scene: { kind: "droplet", spacing: 0.1, end_time: 1, time_step: 0.05, allow_soft: true } },
    ];
    const ids = [];
    for (const body of bodies) ids.push((await api("/v1/jobs", body)).id);
    const sweep = { mode: "grid", axes: { "/scene/spacing": [0.05, 0.035, 0.025, 0.0175], "/scene/method/degree": [3, 4] } };
    const study = await api("/v1/studies", { name: "orders", base: { scene: { kind: "redistance", method: { type: "pcp" } } }, sweep });
    await Promise.all(ids.map(ended));
    await until("the study has ended", async () => (await api(`/v1/studies/${study.id}`)).state === "succeeded");
    const places = { jobs: "jobs", job: `jobs/${ids[0]}`, failed: `jobs/${ids[3]}`, study: `studies/${study.id}`, new: `new?like=${ids[1]}`, compare: `compare/${ids[0]},${ids[1]}`, service: "service" };
    for (const [view, place] of Object.entries(places)) {
        for (const [width, colorScheme, suffix] of [[1280, "light", ""], [1280, "dark", "-dark"], [360, "light", "-narrow"]]) {
            await page.emulateMedia({ colorScheme });
            await page.setViewportSize({ width, height: width > 400 ? 900 : 740 });
            await page.goto(`${url}/#/${place}`);
            await page.reload();
            if (["job", "compare"].includes(view)) await page.locator("canvas[data-ready=yes]").first().waitFor(WAIT);
            await page.waitForTimeout(1500);
            await page.screenshot({ path: `${folder}/page-${view}${suffix}.png` });
        }
    }
};

/** What is measured by hand: pictures a second of 250,000 points, time to the first paint, memory of a tab. */
steps.speed = async () => {
    const { id } = await api("/v1/jobs", { name: "many points", scene: { kind: "redistance", dimension: 3, spacing: 0.0151, method: { type: "pcp", degree: 2 } } });
    await page.goto(`${url}/`);
    await page.waitForTimeout(1000);
    const paint = await page.evaluate(() => performance.getEntriesByName("first-contentful-paint")[0]?.startTime);
    const job = await ended(id);
    check(job.state === "succeeded", JSON.stringify(job));
    await page.goto(`${url}/#/jobs/${id}`);
    await page.locator("canvas[data-ready=yes]").first().waitFor({ timeout: 120_000 });
    await page.waitForTimeout(2000);
    const times = await page.locator(".canvas canvas").first().evaluate((canvas) => Array.from({ length: 20 }, () => canvas.drawNow(true)));
    times.sort((a, b) => a - b);
    process.stderr.write(`first paint ${paint?.toFixed(0)} ms; ${job.progress.particles} points, ${(1000 / times[10]).toFixed(1)} pictures a second (median of 20)\n`);
    const minutes = Number(process.env.MENISCUS_TAB_MINUTES ?? 0);
    if (minutes > 0) {
        const running = await api("/v1/jobs", { ...vortex(0.01, 1000), name: "it runs for long" });
        await page.goto(`${url}/#/jobs/${running.id}`);
        const heap = () => page.evaluate(() => performance.memory.usedJSHeapSize);
        await page.waitForTimeout(20_000);
        const first = await heap();
        await page.waitForTimeout(60_000 * minutes);
        process.stderr.write(`memory of the tab: ${(first / 1e6).toFixed(0)} MB at first, ${((await heap()) / 1e6).toFixed(0)} MB after ${minutes} minutes\n`);
    }
};

/** What is measured by hand: how a list of 10,000 jobs scrolls. */
steps.scroll = async () => {
    const spacings = Array.from({ length: 100 }, (_, k) => 0.05 + k * 1e-4);
    const ends = Array.from({ length: 100 }, (_, k) => 1000 + k);
    const base = { scene: { kind: "vortex", flow: { type: "single_vortex", period: 8 } } };
    const study = await api("/v1/studies", { name: "ten thousand", base, sweep: { mode: "grid", axes: { "/scene/spacing": spacings, "/scene/end_time": ends } } });
    await page.goto(`${url}/#/jobs?study=${study.id}`);
    await page.getByText("10,000", { exact: true }).waitFor({ timeout: 120_000 });
    const gaps = await page.locator(".scroll").evaluate(async (place) => {
        const found = [];
        let last = performance.now();
        for (let k = 0; k < 300; k += 1) {
            place.scrollTop += place.scrollHeight / 300;
            const now = await new Promise((resolve) => requestAnimationFrame(resolve));
            found.push(now - last);
            last = now;
        }
        return found.sort((a, b) => a - b);
    });
    process.stderr.write(`scrolling through 10,000 jobs: a picture every ${gaps[150].toFixed(0)} ms (median), ${gaps[285].toFixed(0)} ms (95 %), ${gaps[299].toFixed(0)} ms (longest)\n`);
};

try {
    await steps[name]();
    check(wrong.length === 0, wrong.join("\n"));
} catch (error) {
    await page.screenshot({ path: `${process.env.TMPDIR ?? "/tmp"}/meniscus-browser-${name}.png`, fullPage: true }).catch(() => {});
    process.stderr.write(`${name}: ${error.stack}\n${wrong.join("\n")}\n${await page.locator("body").innerText().catch(() => "")}\n`);
    process.exitCode = 1;
}
await browser.close();
process.exit();
