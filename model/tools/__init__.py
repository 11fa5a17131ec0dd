"""Motors as other tools and data sheets state them, converted into a motor's file with every step
shown."""
