"""What happened, in Rerun: live and on disk."""

import os

os.environ.setdefault("RUST_LOG", "warn,re_log_encoding::rrd::file_sink=error")  # its files get their footer later
