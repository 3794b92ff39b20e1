"""The least that a server can do: a bare ROUTER that sends back what it gets."""

from __future__ import annotations

import zmq


def main() -> None:
    """Prints its address, and echoes until it is terminated."""
    with zmq.Context() as context, context.socket(zmq.ROUTER) as router:
        router.bind("tcp://127.0.0.1:*")
        print(router.getsockopt_string(zmq.LAST_ENDPOINT), flush=True)
        while True:
            router.send_multipart(router.recv_multipart())


if __name__ == "__main__":
    main()
