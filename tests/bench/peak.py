"""peak.py - run a command; then say on standard output how much memory it had resident at most: peak_kib N."""
import resource
import subprocess
import sys

status = subprocess.run(sys.argv[1:], check=False).returncode
print("peak_kib", resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
sys.exit(status)
