"""Who may reach the bus and do what: open endpoints, access rights, router configurations."""
