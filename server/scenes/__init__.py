"""The 3D panes: one viser server per pane and browser session, reached only through our own port."""
