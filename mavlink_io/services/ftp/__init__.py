"""Client and server of MAVLink FTP (https://mavlink.io/en/services/ftp.html)."""
