"""What goes over the wire: messages, capabilities, and the frames that carry them."""
