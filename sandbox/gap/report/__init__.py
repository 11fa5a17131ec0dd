"""What a diagnosis says: answers, page, traces, `diagnosis.json`, the recording to make next."""
