-- The database of a workspace as schema 0001 wrote it, from `sqlite3 robotrue.db .dump`. Never altered.
BEGIN TRANSACTION;
CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "alembic_version" VALUES('0001');
CREATE TABLE attachments (
	id VARCHAR(36) NOT NULL, 
	version INTEGER NOT NULL, 
	role VARCHAR(40) NOT NULL, 
	position INTEGER NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	sha256 VARCHAR(64) NOT NULL, 
	PRIMARY KEY (id, version, role, position), 
	FOREIGN KEY(id) REFERENCES items (id), 
	FOREIGN KEY(sha256) REFERENCES blobs (sha256)
);
CREATE TABLE blobs (
	sha256 VARCHAR(64) NOT NULL, 
	place VARCHAR(40) NOT NULL, 
	size BIGINT NOT NULL, 
	created DATETIME NOT NULL, 
	PRIMARY KEY (sha256)
);
CREATE TABLE cells (
	id VARCHAR(36) NOT NULL, 
	version INTEGER NOT NULL, 
	latest BOOLEAN NOT NULL, 
	deleted BOOLEAN NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	note TEXT NOT NULL, 
	created DATETIME NOT NULL, 
	detail JSON NOT NULL, 
	digest VARCHAR(64) NOT NULL, 
	robot VARCHAR(200) NOT NULL, 
	frame VARCHAR(40) NOT NULL, 
	PRIMARY KEY (id, version), 
	CONSTRAINT fk_cells_id FOREIGN KEY(id) REFERENCES items (id)
);
CREATE TABLE documents (
	id VARCHAR(36) NOT NULL, 
	version INTEGER NOT NULL, 
	latest BOOLEAN NOT NULL, 
	deleted BOOLEAN NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	note TEXT NOT NULL, 
	created DATETIME NOT NULL, 
	detail JSON NOT NULL, 
	kind VARCHAR(40) NOT NULL, 
	PRIMARY KEY (id, version), 
	CONSTRAINT fk_documents_id FOREIGN KEY(id) REFERENCES items (id)
);
INSERT INTO "documents" VALUES('4b547b0d-8cd0-462e-ad6f-821594260f30',1,0,0,'poses for the left bench','cold','2026-11-21 23:08:58.404986','{"poses": 30}','plan');
INSERT INTO "documents" VALUES('df236572-906a-4c17-a522-5542cc23982c',1,0,0,'to the customer','','2026-11-21 23:08:58.534090','{}','report');
INSERT INTO "documents" VALUES('df236572-906a-4c17-a522-5542cc23982c',2,1,0,'to the customer, signed','','2026-11-21 23:08:58.596670','{}','report');
INSERT INTO "documents" VALUES('4b547b0d-8cd0-462e-ad6f-821594260f30',2,1,1,'poses for the left bench','cold','2026-11-21 23:08:58.641705','{"poses": 30}','plan');
CREATE TABLE drift_checks (
	id VARCHAR(36) NOT NULL, 
	version INTEGER NOT NULL, 
	latest BOOLEAN NOT NULL, 
	deleted BOOLEAN NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	note TEXT NOT NULL, 
	created DATETIME NOT NULL, 
	detail JSON NOT NULL, 
	poses INTEGER NOT NULL, 
	statistic FLOAT NOT NULL, 
	p_value FLOAT NOT NULL, 
	verdict VARCHAR(40) NOT NULL, 
	PRIMARY KEY (id, version), 
	CONSTRAINT fk_drift_checks_id FOREIGN KEY(id) REFERENCES items (id)
);
CREATE TABLE items (
	id VARCHAR(36) NOT NULL, 
	noun VARCHAR(40) NOT NULL, 
	created DATETIME NOT NULL, 
	PRIMARY KEY (id)
);
INSERT INTO "items" VALUES('4b547b0d-8cd0-462e-ad6f-821594260f30','document','2026-11-21 23:08:58.404986');
INSERT INTO "items" VALUES('df236572-906a-4c17-a522-5542cc23982c','document','2026-11-21 23:08:58.534090');
INSERT INTO "items" VALUES('323b8b73-fa48-44c8-91ea-e7687a7afc52','robot','2026-11-21 23:08:58.674177');
CREATE TABLE jobs (
	id VARCHAR(36) NOT NULL, 
	kind VARCHAR(40) NOT NULL, 
	parameters JSON NOT NULL, 
	state VARCHAR(40) NOT NULL, 
	progress FLOAT NOT NULL, 
	text TEXT NOT NULL, 
	remarks JSON NOT NULL, 
	result JSON, 
	error JSON, 
	attempts INTEGER NOT NULL, 
	attempts_allowed INTEGER NOT NULL, 
	cancel BOOLEAN NOT NULL, 
	worker VARCHAR(200) NOT NULL, 
	heartbeat FLOAT NOT NULL, 
	submitted DATETIME NOT NULL, 
	started DATETIME, 
	finished DATETIME, 
	PRIMARY KEY (id)
);
INSERT INTO "jobs" VALUES('2e504c69-47a9-47db-a3cc-da4553e185ca','plan','{"cell": "left", "poses": 30}','queued',0.0,'','[]',NULL,NULL,0,3,0,'',0.0,'2026-11-21 23:08:58.702537',NULL,NULL);
CREATE TABLE journal (
	number INTEGER NOT NULL, 
	entry VARCHAR(36) NOT NULL, 
	at DATETIME NOT NULL, 
	action VARCHAR(40) NOT NULL, 
	noun VARCHAR(40) NOT NULL, 
	item VARCHAR(36) NOT NULL, 
	version INTEGER NOT NULL, 
	detail JSON NOT NULL, 
	PRIMARY KEY (number), 
	UNIQUE (entry)
);
INSERT INTO "journal" VALUES(1,'b7f0fcb5-2278-453b-94e4-142b58f0b10d','2026-11-21 23:08:58.416899','added','document','4b547b0d-8cd0-462e-ad6f-821594260f30',1,'{"name": "poses for the left bench"}');
INSERT INTO "journal" VALUES(2,'d0618e3d-99b6-4f05-8dfa-1d4e73e7658a','2026-11-21 23:08:58.534985','added','document','df236572-906a-4c17-a522-5542cc23982c',1,'{"name": "to the customer"}');
INSERT INTO "journal" VALUES(3,'67952f44-0526-41bf-8663-521bdc9e2fb6','2026-11-21 23:08:58.606432','changed','document','df236572-906a-4c17-a522-5542cc23982c',2,'{"name": "to the customer, signed"}');
INSERT INTO "journal" VALUES(4,'53427d53-d2fb-4963-b8f0-4f2d4411f817','2026-11-21 23:08:58.643266','deleted','document','4b547b0d-8cd0-462e-ad6f-821594260f30',2,'{"name": "poses for the left bench"}');
INSERT INTO "journal" VALUES(5,'198f6027-8b2e-4d8e-8957-27fea4775814','2026-11-21 23:08:58.675324','added','robot','323b8b73-fa48-44c8-91ea-e7687a7afc52',1,'{"name": "KUKA KR160 R1570"}');
INSERT INTO "journal" VALUES(6,'cd02cd69-a094-467e-95d7-84876d1165b4','2026-11-21 23:08:58.702806','submitted','job','2e504c69-47a9-47db-a3cc-da4553e185ca',0,'{"kind": "plan"}');
CREATE TABLE links (
	id VARCHAR(36) NOT NULL, 
	version INTEGER NOT NULL, 
	role VARCHAR(40) NOT NULL, 
	position INTEGER NOT NULL, 
	to_id VARCHAR(36) NOT NULL, 
	to_version INTEGER NOT NULL, 
	PRIMARY KEY (id, version, role, position), 
	FOREIGN KEY(id) REFERENCES items (id), 
	FOREIGN KEY(to_id) REFERENCES items (id)
);
INSERT INTO "links" VALUES('df236572-906a-4c17-a522-5542cc23982c',1,'plan',0,'4b547b0d-8cd0-462e-ad6f-821594260f30',1);
INSERT INTO "links" VALUES('df236572-906a-4c17-a522-5542cc23982c',2,'plan',0,'4b547b0d-8cd0-462e-ad6f-821594260f30',1);
CREATE TABLE measurement_sets (
	id VARCHAR(36) NOT NULL, 
	version INTEGER NOT NULL, 
	latest BOOLEAN NOT NULL, 
	deleted BOOLEAN NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	note TEXT NOT NULL, 
	created DATETIME NOT NULL, 
	detail JSON NOT NULL, 
	frame VARCHAR(40) NOT NULL, 
	poses INTEGER NOT NULL, 
	dof INTEGER NOT NULL, 
	full_poses INTEGER NOT NULL, 
	data VARCHAR(64) NOT NULL, 
	samples VARCHAR(64) NOT NULL, 
	PRIMARY KEY (id, version), 
	CONSTRAINT fk_measurement_sets_id FOREIGN KEY(id) REFERENCES items (id), 
	FOREIGN KEY(samples) REFERENCES blobs (sha256)
);
CREATE TABLE models (
	id VARCHAR(36) NOT NULL, 
	version INTEGER NOT NULL, 
	latest BOOLEAN NOT NULL, 
	deleted BOOLEAN NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	note TEXT NOT NULL, 
	created DATETIME NOT NULL, 
	detail JSON NOT NULL, 
	kind VARCHAR(40) NOT NULL, 
	method VARCHAR(40) NOT NULL, 
	robot VARCHAR(200) NOT NULL, 
	identity VARCHAR(64) NOT NULL, 
	made_by VARCHAR(40) NOT NULL, 
	settings JSON NOT NULL, 
	PRIMARY KEY (id, version), 
	CONSTRAINT fk_models_id FOREIGN KEY(id) REFERENCES items (id)
);
CREATE TABLE programs (
	id VARCHAR(36) NOT NULL, 
	version INTEGER NOT NULL, 
	latest BOOLEAN NOT NULL, 
	deleted BOOLEAN NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	note TEXT NOT NULL, 
	created DATETIME NOT NULL, 
	detail JSON NOT NULL, 
	stage VARCHAR(40) NOT NULL, 
	dialect VARCHAR(40) NOT NULL, 
	file_count INTEGER NOT NULL, 
	bytes BIGINT NOT NULL, 
	PRIMARY KEY (id, version), 
	CONSTRAINT fk_programs_id FOREIGN KEY(id) REFERENCES items (id)
);
CREATE TABLE registrations (
	id VARCHAR(36) NOT NULL, 
	version INTEGER NOT NULL, 
	latest BOOLEAN NOT NULL, 
	deleted BOOLEAN NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	note TEXT NOT NULL, 
	created DATETIME NOT NULL, 
	detail JSON NOT NULL, 
	method VARCHAR(40) NOT NULL, 
	verdict VARCHAR(40) NOT NULL, 
	frames INTEGER NOT NULL, 
	identity VARCHAR(64) NOT NULL, 
	PRIMARY KEY (id, version), 
	CONSTRAINT fk_registrations_id FOREIGN KEY(id) REFERENCES items (id)
);
CREATE TABLE robots (
	id VARCHAR(36) NOT NULL, 
	version INTEGER NOT NULL, 
	latest BOOLEAN NOT NULL, 
	deleted BOOLEAN NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	note TEXT NOT NULL, 
	created DATETIME NOT NULL, 
	detail JSON NOT NULL, 
	maker VARCHAR(40) NOT NULL, 
	dof INTEGER NOT NULL, 
	identity VARCHAR(64) NOT NULL, 
	PRIMARY KEY (id, version), 
	CONSTRAINT fk_robots_id FOREIGN KEY(id) REFERENCES items (id)
);
INSERT INTO "robots" VALUES('323b8b73-fa48-44c8-91ea-e7687a7afc52',1,1,0,'KUKA KR160 R1570','','2026-11-21 23:08:58.674177','{"reach_m": 1.57}','kuka',6,'aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa');
CREATE TABLE tools (
	id VARCHAR(36) NOT NULL, 
	version INTEGER NOT NULL, 
	latest BOOLEAN NOT NULL, 
	deleted BOOLEAN NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	note TEXT NOT NULL, 
	created DATETIME NOT NULL, 
	detail JSON NOT NULL, 
	identity VARCHAR(64) NOT NULL, 
	PRIMARY KEY (id, version), 
	CONSTRAINT fk_tools_id FOREIGN KEY(id) REFERENCES items (id)
);
CREATE TABLE workspace (
	id VARCHAR(36) NOT NULL, 
	created DATETIME NOT NULL, 
	made_by VARCHAR(40) NOT NULL, 
	PRIMARY KEY (id)
);
INSERT INTO "workspace" VALUES('5d633ed4-b093-4d4f-b424-c383dd857f1c','2026-11-21 23:08:58.319288','0.1.0');
CREATE INDEX ix_links_to ON links (to_id, role);
CREATE INDEX ix_attachments_sha256 ON attachments (sha256);
CREATE INDEX ix_robots_newest ON robots (latest, deleted, created, id);
CREATE INDEX ix_tools_newest ON tools (latest, deleted, created, id);
CREATE INDEX ix_cells_newest ON cells (latest, deleted, created, id);
CREATE INDEX ix_measurement_sets_newest ON measurement_sets (latest, deleted, created, id);
CREATE INDEX ix_models_newest ON models (latest, deleted, created, id);
CREATE INDEX ix_registrations_newest ON registrations (latest, deleted, created, id);
CREATE INDEX ix_programs_newest ON programs (latest, deleted, created, id);
CREATE INDEX ix_documents_newest ON documents (latest, deleted, created, id);
CREATE INDEX ix_drift_checks_newest ON drift_checks (latest, deleted, created, id);
CREATE INDEX ix_robots_identity ON robots (identity);
CREATE INDEX ix_tools_identity ON tools (identity);
CREATE INDEX ix_measurement_sets_data ON measurement_sets (data);
CREATE INDEX ix_models_identity ON models (identity);
CREATE INDEX ix_jobs_state ON jobs (state, submitted);
CREATE INDEX ix_jobs_submitted ON jobs (submitted, id);
CREATE INDEX ix_journal_item ON journal (item);
COMMIT;
