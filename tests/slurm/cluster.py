"""A Slurm cluster of one controller and three nodes on this computer, on loopback, stopped at the end."""

import os
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from pathlib import Path

NODES = ("n1", "n2", "n3")
PORTS = {"slurmctld": 17001, "n1": 17011, "n2": 17012, "n3": 17013}
PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "squeue", "scancel", "sinfo")


def missing():
    """Programs that are not installed."""
    return [name for name in PROGRAMS if shutil.which(name, path=_path()) is None]


def _path():
    return os.environ["PATH"] + ":/usr/sbin:/sbin"


class Cluster:
    """Started when it is made, stopped by :meth:`close`."""

    def __init__(self):
        self.folder = Path(tempfile.mkdtemp(prefix="airloop-slurm-"))
        self.processes = {}
        self.environment = dict(os.environ, PATH=_path(), SLURM_CONF=str(self.folder / "slurm.conf"))
        try:
            self._munge()
            self._configure()
            self._start("slurmctld", ["slurmctld", "-D", "-c"])
            for node in NODES:
                (self.folder / f"spool.{node}").mkdir()
                self._start(node, ["slurmd", "-D", "-N", node])
            self.wait(lambda: self.states().count("idle") == len(NODES), "all nodes are idle", 60)
        except BaseException:
            self.close()
            raise

    def close(self):
        """Ends its daemons and removes its folder."""
        for name in reversed(list(self.processes)):
            process = self.processes.pop(name)
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)

    def ask(self, *words):
        """What a program of Slurm prints."""
        done = subprocess.run(words, env=self.environment, capture_output=True, text=True)
        if done.returncode != 0:
            raise RuntimeError(f"{' '.join(words)}: {done.stderr.strip()}")
        return done.stdout

    def states(self):
        """State of each node, e.g. idle."""
        try:
            return self.ask("sinfo", "--noheader", "--Node", "--format=%T").split()
        except RuntimeError:
            return []

    def kill_node(self, node):
        """Kills the daemon of a node and all that runs on it, as a loss of power does; how many processes that were."""
        daemon = self.processes.pop(node)
        daemon.kill()
        daemon.wait()
        running = _processes_of(node, self.folder)
        for process in running:
            os.kill(process, signal.SIGKILL)
        return len(running)

    def working_node(self):
        """A node that runs something, none if all are idle."""
        return next((node for node in NODES if _processes_of(node, self.folder)), None)

    def restarts(self, job):
        """Number of times that shards of a job were queued again."""
        return sum(map(int, re.findall(r"Restarts=(\d+)", self.ask("scontrol", "show", "job", str(job)))))

    def wait_for_job(self, job, seconds):
        """Waits until a job is neither queued nor running."""
        def over():
            return not self.ask("squeue", "--noheader", f"--jobs={job}").strip()

        self.wait(over, f"job {job} is over", seconds)

    def wait(self, condition, words, seconds):
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                logs = "\n".join(path.read_text()[-1500:] for path in sorted(self.folder.glob("*.log")))
                raise RuntimeError(f"not within {seconds} s: {words}; states: {self.states()}\n{logs}")
            time.sleep(0.3)

    def _start(self, name, words):
        with open(self.folder / f"{name}.log", "w") as log:
            self.processes[name] = subprocess.Popen(words, env=self.environment, stdout=log, stderr=log)

    def _munge(self):
        key = self.folder / "munge.key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o400)
        self.folder.chmod(0o755)
        words = ["munged", "--foreground", "--force", f"--key-file={key}", f"--socket={self.folder}/munge.socket"]
        words += [f"--{name}-file={self.folder}/munge.{name}" for name in ("log", "pid", "seed")]
        self._start("munged", words)
        self.wait(lambda: (self.folder / "munge.socket").exists(), "munged listens", 10)

    def _configure(self):
        host = socket.gethostname().split(".")[0]
        nodes = "\n".join(
            f"NodeName={node} NodeHostname={host} NodeAddr=127.0.0.1 Port={PORTS[node]} CPUs=1 RealMemory=256"
            for node in NODES
        )
        (self.folder / "state").mkdir()
        (self.folder / "slurm.conf").write_text(f"""\
ClusterName=airloop
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={PORTS["slurmctld"]}
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={self.folder}/munge.socket,cred_expire=10
CredType=cred/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
StateSaveLocation={self.folder}/state
SlurmdSpoolDir={self.folder}/spool.%n
SlurmctldPidFile={self.folder}/slurmctld.pid
SlurmdPidFile={self.folder}/slurmd.%n.pid
SlurmdParameters=config_overrides
SlurmdTimeout=10
KillWait=2
ReturnToService=2
JobRequeue=1
SchedulerParameters=batch_sched_delay=1,sched_interval=2
SwitchType=switch/none
{nodes}
PartitionName=all Nodes={",".join(NODES)} Default=YES MaxTime=INFINITE State=UP
""")


def _processes_of(node, folder):
    """Processes that the cluster of a folder started on a node, with those that watch them."""
    wanted = (f"SLURMD_NODENAME={node}".encode(), f"SLURM_CONF={folder}".encode())
    found = set()
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            environment = (entry / "environ").read_bytes().split(b"\0")
            parent = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
            parent_name = Path(f"/proc/{parent}/comm").read_text().strip()
        except (OSError, ValueError, IndexError):
            continue
        ours = any(word.startswith(wanted[1]) for word in environment)
        if ours and wanted[0] in environment:
            found |= {int(entry.name)} | ({parent} if parent_name == "slurmstepd" else set())
    return found
