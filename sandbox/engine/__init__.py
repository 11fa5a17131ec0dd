"""What Python itself needs: many tasks on several processes or on a cluster; names that the files
of a user share with ours."""
