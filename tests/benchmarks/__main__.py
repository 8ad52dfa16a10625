"""All benchmarks that write results, one after the other: `python -m tests.benchmarks`."""

from tests.benchmarks import geometries, online, peers, reliability, speed, stability, startup

if __name__ == "__main__":
    speed.main()
    peers.main()
    stability.main()
    reliability.main([])
    online.main()
    geometries.main()
    startup.main([])
