"""Loop transfer functions, margins, root loci and modes."""
