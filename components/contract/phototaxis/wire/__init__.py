"""What travels on the bus: messages, their encoding, the table of topics, and the page about them."""
