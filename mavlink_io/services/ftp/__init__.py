"""MAVLink FTP, https://mavlink.io/en/services/ftp.html: both ends of it."""
