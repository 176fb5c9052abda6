"""`epuck-sim`, and `python -m epuck_sim`."""


def main() -> None:
    """Run the command; worker processes import this module, too, and must not wait for the command line."""
    from epuck_sim.cli.app import main as run_command  # noqa: PLC0415

    run_command()


if __name__ == "__main__":
    main()
