"""Links to devices: serial lines, I²C buses, I/O ports, output lines, analogue inputs."""
