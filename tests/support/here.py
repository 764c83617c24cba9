"""An executor of runs for tests."""

from humanclaw_bench.worker import Worker


class Here:
    """An executor as a plugin would bring one: it plays in this process."""

    stopping = False

    def reports(self, job, queue, out):
        with Worker(job, out, lambda: self.stopping, "here") as worker:
            while not self.stopping and (spec := queue.take()):
                yield worker.play(spec)

    def stop(self):
        self.stopping = True
