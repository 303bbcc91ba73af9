// What a view that cannot be drawn leaves: its error, and a way on. The rest of the page stays.
import { Component, type ComponentChildren } from "preact";
import { Trouble } from "./basics";

interface Props {
    children: ComponentChildren;
}

export class Boundary extends Component<Props, { error: Error | null }> {
    override state: { error: Error | null } = { error: null };

    static override getDerivedStateFromError(error: Error): { error: Error } {
        return { error };
    }

    override render() {
        if (!this.state.error) return this.props.children;
        return (
            <main>
                <h1>This view cannot be shown</h1>
                <Trouble error={this.state.error} />
                <p><button type="button" onClick={() => this.setState({ error: null })}>try again</button></p>
            </main>
        );
    }
}
